// Delays of depth and pictures whose rows are exposed one after the other.
#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/parallel.h"
#include "libmap/refine/bundle_adjustment.h"
#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/feature_tracks.h"
#include "libmap/refine/sensor_calibration.h"
#include "tests/libmap/refine/synthetic_features.h"

namespace timing_test {

using graspmap_test::beside;
using graspmap_test::random_points;
using graspmap_test::random_step;
using graspmap_test::see_points;
using graspmap_test::uniform;
using libmap::CalibratedObservation;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::Vector6d;

Vector6d random_six() {
  Vector6d six;
  for (int n = 0; n < 6; ++n) six[n] = uniform(-1.0, 1.0);
  return six;
}

// What an observation depends on, in one row: a step of the pose, the motion, the point, and the
// camera's numbers with four of the spline.
constexpr Eigen::Index motion_at = 6;
constexpr Eigen::Index point_at = 12;
constexpr Eigen::Index camera_at = 15;
constexpr Eigen::Index spline_at = camera_at + libmap::spline_at;
using Unknowns = Eigen::Matrix<double, spline_at + 4, 1>;

libmap::CalibratedResidual seen_at(const libmap::CalibratedFeature& feature, const Pose& pose,
                                   const Unknowns& at) {
  libmap::CalibratedResidual seen;
  EXPECT_TRUE(feature.evaluate(libmap::moved(pose, at.head<6>()), at.segment<6>(motion_at),
                               at.data() + camera_at, at.segment<3>(point_at), seen, true));
  return seen;
}

// By central differences.
TEST(CalibratedFeature, DerivativesAreThoseOfDifferences) {
  const libmap::Camera camera = graspmap_test::feature_camera();
  const FrameFeatures frame = see_points(1, Pose::Identity(), {{1.6, 0.3, -0.2}});
  CalibratedObservation calibrated{true, true, true, true};
  calibrated.terms = {0, {0.1, 0.4, 0.4, 0.1}, {0.3, 0.09, 0.5}};
  calibrated.by_step = random_six();
  calibrated.known_step = 0.01 * random_six();
  calibrated.row_share = 0.37;
  const libmap::CalibratedFeature feature(frame.features[0], camera, calibrated);
  const Pose pose = libmap::make_pose({0.02, -0.01, 0.03}, libmap::rotation_of({0.05, -0.08, 0.1}));
  Unknowns at = Unknowns::Zero();
  at.segment<6>(motion_at) << 0.5, -0.3, 0.2, 0.4, -0.6, 0.3;
  at.segment<3>(point_at) << 1.61, 0.28, -0.19;
  at.segment<libmap::spline_at>(camera_at) << 0.01, -0.02, 3.0, -2.0, 0.002, -0.001, 0.003, 0.004,
      0.001, -0.002, 0.012, 0.02, 0.004, -0.002, 0.001;
  at.tail<4>() << 0.001, 0.002, -0.001, 0.003;
  const libmap::CalibratedResidual seen = seen_at(feature, pose, at);
  Eigen::Matrix<double, 3, Unknowns::SizeAtCompileTime> found;
  found << seen.by_pose, seen.by_motion, seen.by_point, seen.by_camera,
      Eigen::Matrix<double, 3, 4>::Zero();
  found.bottomRightCorner<1, 4>() = seen.depth_by_spline;
  constexpr double step = 1e-6;
  for (Eigen::Index n = 0; n < at.size(); ++n) {
    const Unknowns by = step * Unknowns::Unit(n);
    const Eigen::Vector3d expected =
        (seen_at(feature, pose, at + by).residual - seen_at(feature, pose, at - by).residual) /
        (2.0 * step);
    EXPECT_LT((found.col(n) - expected).norm(), 1e-5 * std::max(1.0, expected.norm())) << n;
  }
}

struct Way {
  std::vector<FrameFeatures> frames;
  std::map<int, Pose> truth;
  std::vector<libmap::FeatureTrack> tracks;
  std::vector<libmap::GraphComponent> components = {{{}, 1}};
};

// A camera that sways by up to 0.6 m/s in front of `points`, and whose pictures' rows are exposed
// one after the other. At a steady speed nothing tells the rows' times from the places of the
// points.
Way way_with_rows(const std::vector<Eigen::Vector3d>& points, double rolling_shutter_s,
                  int frames = 10) {
  Way way;
  const auto pose_at = [](double time_s) { return beside(0.4 * std::sin(1.5 * time_s)); };
  for (int node = 1; node <= frames; ++node) {
    const double stamp_s = 0.3 * node;
    FrameFeatures frame = see_points(node, pose_at(stamp_s), points);
    frame.stamp_s = stamp_s;
    for (std::size_t n = 0; n < points.size(); ++n)
      for (int round = 0; round < 4; ++round) {
        const double late_s =
            rolling_shutter_s * libmap::row_share_of(frame.features[n], frame.cameras[0]);
        frame.features[n] = see_points(node, pose_at(stamp_s + late_s), {points[n]}).features[0];
      }
    way.truth[node] = pose_at(stamp_s);
    way.components[0].nodes.push_back(node);
    way.frames.push_back(std::move(frame));
  }
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    libmap::FeatureTrack track;
    for (std::uint32_t f = 0; f < way.frames.size(); ++f) track.observations.push_back({f, n});
    way.tracks.push_back(track);
  }
  return way;
}

TEST(BundleAdjustment, FindsTheTimeOfThePicturesRows) {
  const auto points = random_points(150);
  const Way way = way_with_rows(points, 0.06);
  libmap::BundleAdjustmentOptions options;
  options.max_iterations = 100;
  const auto held =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  options.refine_timing = true;
  const auto free =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  ASSERT_EQ(free.calibration.timing.size(), 1U);
  EXPECT_NEAR(free.calibration.timing[0].rolling_shutter_s, 0.06, 0.006);
  EXPECT_EQ(free.calibration.motion.size(), way.frames.size());
  // At 0.3 s the base goes 0.6 cos(0.45) m/s along its own y, nearly.
  EXPECT_NEAR(free.calibration.motion.at(1).y(), 0.54, 0.08);
  EXPECT_LT(free.final_cost, 0.01 * held.final_cost);
  // Seen with the calibration, frames fit as if all rows had been exposed at once.
  FrameFeatures calibrated = way.frames[4];
  libmap::calibrate(calibrated, free.calibration);
  const Way exact = way_with_rows(points, 0.0);
  double before = 0.0;
  double after = 0.0;
  for (std::size_t n = 0; n < calibrated.features.size(); ++n) {
    const Eigen::Vector2f& wanted = exact.frames[4].features[n].ray;
    before += (way.frames[4].features[n].ray - wanted).norm();
    after += (calibrated.features[n].ray - wanted).norm();
  }
  EXPECT_LT(after, 0.5 * before);
}

// From a start that is far off, with motions and times free.
TEST(BundleAdjustment, IsTheSameForAnyNumberOfThreadsAndNeverWorse) {
  const Way way = way_with_rows(random_points(700), 0.06);
  std::map<int, Pose> start = way.truth;
  for (auto& [node, pose] : start) pose = libmap::moved(pose, random_step(0.03, 0.02));
  const auto adjusted = [&](unsigned threads, int steps) {
    const libmap::ThreadLimit limit(threads);
    libmap::BundleAdjustmentOptions options;
    options.refine_timing = options.refine_intrinsics = true;
    options.max_iterations = steps;
    return libmap::adjust_bundle(way.frames, way.tracks, start, {}, way.components, options);
  };
  double cost = adjusted(1, 1).initial_cost;
  for (int steps = 1; steps < 8; ++steps) {
    const auto one = adjusted(1, steps);
    const auto three = adjusted(3, steps);
    EXPECT_LE(one.final_cost, cost) << steps;
    cost = one.final_cost;
    EXPECT_EQ(one.final_cost, three.final_cost);
    EXPECT_EQ(one.calibration.timing[0].rolling_shutter_s,
              three.calibration.timing[0].rolling_shutter_s);
    for (const auto& [node, pose] : one.map_from_base)
      EXPECT_EQ(pose.matrix(), three.map_from_base.at(node).matrix());
  }
}

TEST(BundleAdjustment, FindsNoTimeWhereRowsAreExposedAtOnce) {
  const Way way = way_with_rows(random_points(150), 0.0);
  libmap::BundleAdjustmentOptions options;
  options.refine_timing = true;
  const auto found =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  EXPECT_NEAR(found.calibration.timing.at(0).rolling_shutter_s, 0.0, 1e-4);
  EXPECT_NEAR(found.calibration.timing.at(0).depth_delay_s, 0.0, 1e-4);
}

// A calibration rests on a part of a long scan. The frames that it does not rest on have motions
// too; one that nothing joins has that of its neighbors.
TEST(SensorCalibration, AllFramesHaveMotions) {
  constexpr int count = 90;
  constexpr int alone = 50;
  const auto points = random_points(60);
  Way way = way_with_rows(points, 0.06, count);
  std::vector<libmap::FeatureLink> links;
  for (std::size_t n = 0; n + 1 < way.frames.size(); ++n) {
    if (n + 1 == alone || n + 2 == alone) continue;
    libmap::FeatureLink link;
    link.frames = {n, n + 1};
    link.link = {way.frames[n].node, way.frames[n + 1].node, libmap::LinkType::neighbor,
                 way.truth.at(way.frames[n].node).inverse() * way.truth.at(way.frames[n + 1].node),
                 libmap::Matrix6d::Identity()};
    link.matches = graspmap_test::same_numbers(points.size());
    links.push_back(link);
  }
  std::erase(way.components[0].nodes, alone);
  way.components.push_back({{alone}, alone});
  way.truth.at(alone) = Pose::Identity();  // anywhere
  libmap::SensorCalibration calibration;
  calibration.timing = {{0.0, 0.06}};
  for (const bool hold_poses : {false, true}) {
    libmap::find_motions({way.frames, links, way.truth, {}, way.components, {}}, hold_poses,
                         calibration);
    ASSERT_EQ(calibration.motion.size(), way.frames.size());
    for (const auto& [node, motion] : calibration.motion)
      EXPECT_NEAR(motion.y(), 0.6 * std::cos(1.5 * 0.3 * node), node == alone ? 0.1 : 0.03) << node;
  }
}

// A base that goes along x in front of a wall: depth that is late is nearer by the way it went.
TEST(SensorCalibration, LateDepthIsMovedBack) {
  libmap::SensorCalibration calibration;
  calibration.timing = {{0.05, 0.0}};
  calibration.motion[1] << 0.4, 0.0, 0.0, 0.0, 0.0, 0.0;
  const FrameFeatures frame = see_points(1, Pose::Identity(), {{1.5, 0.1, 0.1}});
  const Pose pose = libmap::color_from_depth_of(frame, frame.features[0], calibration);
  // Forward is z in the camera: the depth's camera was 2 cm ahead.
  EXPECT_LT((pose.translation() - Eigen::Vector3d(0.0, 0.0, 0.02)).norm(), 1e-12);
  calibration.timing[0].rolling_shutter_s = 0.05;
  const double row = libmap::row_share_of(frame.features[0], frame.cameras[0]);
  EXPECT_NEAR(libmap::color_from_depth_of(frame, frame.features[0], calibration).translation().z(),
              0.4 * (0.05 - 0.05 * row), 1e-12);
}

}  // namespace timing_test
