// Delays of depth and pictures whose rows are exposed one after the other.
#include <gtest/gtest.h>

#include <cmath>

#include "libmap/refine/bundle_adjustment.h"
#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/feature_tracks.h"
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

// Numbers of an observation's blocks, all of them unknown.
struct Blocks {
  std::vector<std::vector<double>> numbers;

  std::vector<const double*> pointers() const {
    std::vector<const double*> all;
    for (const auto& block : numbers) all.push_back(block.data());
    return all;
  }
};

Eigen::Vector3d residual_of(const libmap::ObservationCost& cost, const Blocks& blocks) {
  Eigen::Vector3d residual;
  EXPECT_TRUE(cost.Evaluate(blocks.pointers().data(), residual.data(), nullptr));
  return residual;
}

// By central differences; the quaternion stays a unit one.
TEST(ObservationCost, DerivativesAreThoseOfDifferences) {
  const libmap::Camera camera = graspmap_test::feature_camera();
  const FrameFeatures frame = see_points(1, Pose::Identity(), {{1.6, 0.3, -0.2}});
  CalibratedObservation calibrated{true, true, true, true};
  calibrated.terms = {0, {0.1, 0.4, 0.4, 0.1}, {0.3, 0.09, 0.5}};
  calibrated.by_step = random_six();
  calibrated.known_step = 0.01 * random_six();
  calibrated.row_share = 0.37;
  const libmap::ObservationCost cost(frame.features[0], camera, calibrated);
  const Eigen::Quaterniond q = libmap::rotation_of({0.05, -0.08, 0.1});
  Blocks blocks{{{q.x(), q.y(), q.z(), q.w(), 0.02, -0.01, 0.03},
                 {1.61, 0.28, -0.19},
                 {0.01, -0.02, 3.0, -2.0},
                 {0.001},
                 {0.002},
                 {-0.001},
                 {0.003},
                 {0.004, -0.002, 0.001},
                 {0.002, -0.001, 0.003, 0.004, 0.001, -0.002},
                 {0.5, -0.3, 0.2, 0.4, -0.6, 0.3},
                 {0.012, 0.02}}};
  std::vector<std::vector<double>> derivatives;
  std::vector<double*> pointers;
  for (const auto& block : blocks.numbers) derivatives.emplace_back(3 * block.size());
  for (auto& block : derivatives) pointers.push_back(block.data());
  Eigen::Vector3d residual;
  ASSERT_TRUE(cost.Evaluate(blocks.pointers().data(), residual.data(), pointers.data()));
  constexpr double step = 1e-6;
  for (std::size_t b = 0; b < blocks.numbers.size(); ++b) {
    const std::size_t size = blocks.numbers[b].size();
    for (std::size_t n = 0; n < size; ++n) {
      std::vector<double> direction(size, 0.0);
      direction[n] = 1.0;
      if (b == 0 && n < 4)  // tangent to the unit sphere
        for (std::size_t k = 0; k < 4; ++k)
          direction[k] -= blocks.numbers[0][k] * blocks.numbers[0][n];
      Eigen::Vector3d expected = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < size; ++k)
        for (std::size_t row = 0; row < 3; ++row)
          expected[static_cast<Eigen::Index>(row)] += derivatives[b][row * size + k] * direction[k];
      Blocks after = blocks;
      Blocks before = blocks;
      for (std::size_t k = 0; k < size; ++k) {
        after.numbers[b][k] += step * direction[k];
        before.numbers[b][k] -= step * direction[k];
      }
      const Eigen::Vector3d found =
          (residual_of(cost, after) - residual_of(cost, before)) / (2.0 * step);
      EXPECT_LT((found - expected).norm(), 1e-5 * std::max(1.0, expected.norm())) << b << " " << n;
    }
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
Way way_with_rows(const std::vector<Eigen::Vector3d>& points, double rolling_shutter_s) {
  Way way;
  const auto pose_at = [](double time_s) { return beside(0.4 * std::sin(1.5 * time_s)); };
  for (int node = 1; node <= 10; ++node) {
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

TEST(BundleAdjustment, FindsNoTimeWhereRowsAreExposedAtOnce) {
  const Way way = way_with_rows(random_points(150), 0.0);
  libmap::BundleAdjustmentOptions options;
  options.refine_timing = true;
  const auto found =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  EXPECT_NEAR(found.calibration.timing.at(0).rolling_shutter_s, 0.0, 1e-4);
  EXPECT_NEAR(found.calibration.timing.at(0).depth_delay_s, 0.0, 1e-4);
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
