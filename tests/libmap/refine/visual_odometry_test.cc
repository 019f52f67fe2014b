#include "libmap/refine/visual_odometry.h"

#include <gtest/gtest.h>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/poses/trajectory_text.h"
#include "tests/libmap/features/synthetic_features.h"

namespace visual_odometry_test {

using graspmap_test::beside;
using graspmap_test::feature_camera;
using graspmap_test::FeatureNoise;
using graspmap_test::see_points;
using graspmap_test::uniform;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::TrackingStart;
using libmap::Vector6d;
using libmap::VisualOdometryOptions;
using libmap::VisualOdometryResult;

// A wall along y, `length_m` of it, which cameras pass that look along x.
std::vector<Eigen::Vector3d> wall(double length_m, double from_m = 0.0) {
  std::vector<Eigen::Vector3d> points;
  const auto count = static_cast<std::size_t>(250.0 * length_m);
  for (std::size_t n = 0; n < count; ++n)
    points.emplace_back(uniform(1.2, 1.8), from_m + uniform(-1.0, length_m + 1.0),
                        uniform(-0.7, 0.7));
  return points;
}

// Features of the points in the image.
FrameFeatures see(int node, const Pose& pose, const std::vector<Eigen::Vector3d>& points,
                  const FeatureNoise& noise = {}) {
  const FrameFeatures all = see_points(node, pose, points, noise);
  FrameFeatures seen = all;
  seen.features.clear();
  seen.descriptors.clear();
  for (std::size_t n = 0; n < all.features.size(); ++n) {
    const libmap::Feature& feature = all.features[n];
    if (feature.depth_m <= 0.1F || std::abs(feature.ray.x()) > 0.7F ||
        std::abs(feature.ray.y()) > 0.58F)
      continue;
    seen.features.push_back(feature);
    const auto first = all.descriptors.begin() + static_cast<std::ptrdiff_t>(128 * n);
    seen.descriptors.insert(seen.descriptors.end(), first, first + 128);
  }
  return seen;
}

FrameFeatures blank(int node) {
  FrameFeatures frame;
  frame.node = node;
  frame.cameras = {feature_camera()};
  return frame;
}

struct Walk {
  std::vector<FrameFeatures> frames;
  std::map<int, Pose> truth;

  void pass(const std::vector<Eigen::Vector3d>& points, double y, const FeatureNoise& noise = {}) {
    const int node = static_cast<int>(frames.size()) + 1;
    truth[node] = beside(y);
    frames.push_back(see(node, beside(y), points, noise));
  }
  void pass_blindly(double y) {
    const int node = static_cast<int>(frames.size()) + 1;
    truth[node] = beside(y);
    frames.push_back(blank(node));
  }
};

VisualOdometryResult track(const Walk& walk, const TrackingStart& start = {},
                           const VisualOdometryOptions& options = {}) {
  return libmap::track_frames(walk.frames, start, {}, options, 1);
}

// Position error of `node` relative to `from`.
double error_of(const Walk& walk, const VisualOdometryResult& result, int from, int node) {
  const Pose truth = walk.truth.at(from).inverse() * walk.truth.at(node);
  const Pose found = result.map_from_base.at(from).inverse() * result.map_from_base.at(node);
  return libmap::step_between(truth, found).norm();
}

libmap::Trajectory trajectory(const std::map<int, Pose>& poses) {
  libmap::Trajectory trajectory;
  for (const auto& [node, pose] : poses) trajectory.push_back({node, 0.0, pose});
  return trajectory;
}

TEST(VisualOdometry, ExactFeaturesGiveTheExactWay) {
  Walk walk;
  const auto points = wall(3.0);
  for (int n = 0; n < 16; ++n) walk.pass(points, 0.2 * n);
  const VisualOdometryResult result = track(walk);
  ASSERT_EQ(result.parts.size(), 1U);
  EXPECT_TRUE(result.losses.empty());
  EXPECT_EQ(result.links.size(), 15U);
  EXPECT_TRUE(result.map_from_base.at(1).isApprox(Pose::Identity(), 0.0));
  for (int node = 2; node <= 16; ++node) EXPECT_LT(error_of(walk, result, 1, node), 2e-5) << node;
  // Each link joins a frame to an earlier key frame.
  const std::set<int> keys(result.key_frames.begin(), result.key_frames.end());
  for (const libmap::FeatureLink& link : result.links) {
    EXPECT_EQ(link.link.type, libmap::LinkType::neighbor);
    EXPECT_LT(link.link.from, link.link.to);
    EXPECT_TRUE(keys.contains(link.link.from));
    EXPECT_FALSE(link.held_out.empty());
  }
}

TEST(VisualOdometry, KeyFramesFollowTheWayTheTurnAndTheMatches) {
  const auto points = wall(1.0);
  Walk walk;
  for (int n = 0; n < 11; ++n) walk.pass(points, 0.08 * n);
  VisualOdometryOptions options;
  options.keyframe_inliers = 0;
  options.keyframe_angle_deg = 180.0;
  options.keyframe_distance_m = 100.0;
  EXPECT_EQ(track(walk, {}, options).key_frames, std::vector<int>{1});
  options.keyframe_distance_m = 0.23;
  EXPECT_EQ(track(walk, {}, options).key_frames, (std::vector<int>{1, 4, 7, 10}));
  options.keyframe_distance_m = 100.0;
  options.keyframe_angle_deg = 3.0;
  const auto turning = track(walk, {}, options).key_frames;
  EXPECT_GT(turning.size(), 1U);
  EXPECT_LT(turning.size(), 11U);
  options.keyframe_angle_deg = 180.0;
  options.keyframe_inliers = 100000;
  EXPECT_EQ(track(walk, {}, options).key_frames.size(), 11U);
}

// Covariances of links match their errors, independent of the stated noise of the features.
TEST(VisualOdometry, CovariancesAreHonest) {
  const auto points = wall(1.0);
  for (const double claimed : {1.0, 2.0}) {
    double sum = 0.0;
    std::size_t links = 0;
    for (int trial = 0; trial < 12; ++trial) {
      Walk walk;
      const FeatureNoise noise{0.4, 0.004, true};
      for (int n = 0; n < 6; ++n) walk.pass(points, 0.15 * n, noise);
      for (FrameFeatures& frame : walk.frames)
        for (libmap::Feature& feature : frame.features) {
          feature.pixel_noise_px *= static_cast<float>(claimed);
          feature.depth_noise_m *= static_cast<float>(claimed);
        }
      const libmap::LinkConsistency consistency =
          libmap::link_consistency(track(walk).links, trajectory(walk.truth));
      sum += consistency.squared_error_per_freedom * static_cast<double>(consistency.links);
      links += consistency.links;
    }
    ASSERT_EQ(links, 60U);
    // Chi-square of 360: 1 +- 0.075.
    EXPECT_NEAR(sum / static_cast<double>(links), 1.0, 0.25) << "claimed x " << claimed;
  }
}

TEST(VisualOdometry, ConsistencyIsThatOfKnownErrors) {
  libmap::FeatureLink link;
  link.link.from = 3;
  link.link.to = 7;
  link.link.information = 100.0 * libmap::Matrix6d::Identity();
  Vector6d error;
  error << 0.1, 0, 0, 0, 0.2, 0;
  const std::map<int, Pose> truth = {{3, beside(1.0)}, {7, libmap::moved(beside(1.0), error)}};
  libmap::FeatureLink unknown = link;
  unknown.link.to = 8;
  const auto found = libmap::link_consistency({link, unknown}, trajectory(truth));
  EXPECT_EQ(found.links, 1U);
  EXPECT_NEAR(found.squared_error_per_freedom, 100.0 * (0.01 + 0.04) / 6.0, 1e-9);
}

TEST(VisualOdometry, ABlankImageCostsOneNode) {
  Walk walk;
  const auto points = wall(2.0);
  for (int n = 0; n < 10; ++n) {
    if (n == 5)
      walk.pass_blindly(0.15 * n);
    else
      walk.pass(points, 0.15 * n);
  }
  const VisualOdometryResult result = track(walk);
  ASSERT_EQ(result.parts.size(), 2U);
  EXPECT_EQ(result.parts[0], (std::vector<int>{1, 2, 3, 4, 5, 7, 8, 9, 10}));
  EXPECT_EQ(result.parts[1], std::vector<int>{6});
  ASSERT_EQ(result.losses.size(), 1U);
  EXPECT_EQ(result.losses[0].node, 6);
  EXPECT_EQ(result.losses[0].relocalized_node, 0);
  EXPECT_NE(result.losses[0].reason.find("0 features"), std::string::npos);
  EXPECT_LT(error_of(walk, result, 1, 10), 2e-5);
}

// After a long gap the camera is at a location that it visited before.
TEST(VisualOdometry, IsFoundAgainByAppearance) {
  Walk walk;
  const auto points = wall(6.0);
  for (int n = 0; n < 20; ++n) walk.pass(points, 0.25 * n);
  for (int n = 0; n < 8; ++n) walk.pass_blindly(5.0);
  for (int n = 0; n < 3; ++n) walk.pass(points, 1.1 + 0.2 * n);
  const VisualOdometryResult result = track(walk);
  EXPECT_EQ(result.parts.size(), 9U);
  EXPECT_EQ(result.parts[0].size(), 23U);
  ASSERT_EQ(result.losses.size(), 9U);
  EXPECT_EQ(result.losses.back().node, 29);
  EXPECT_EQ(result.losses.back().relocalized_node, 29);
  EXPECT_GE(result.losses.back().relocalized_at, 3);
  EXPECT_LE(result.losses.back().relocalized_at, 8);
  EXPECT_EQ(result.relocalized, 1U);
  EXPECT_LT(error_of(walk, result, 1, 31), 3e-5);
  std::size_t closures = 0;
  for (const libmap::FeatureLink& link : result.links)
    closures += link.link.type == libmap::LinkType::local_space_closure ? 1 : 0;
  EXPECT_GE(closures, 2U) << "one alone is not believed";
}

// A poster in one frame of the first location is also at the second location.
TEST(VisualOdometry, OneLookAlikeIsNotBelieved) {
  Walk walk;
  const auto points = wall(4.0);
  const auto elsewhere = wall(3.0, 50.0);
  std::vector<Eigen::Vector3d> poster(3000, {-10.0, 0.0, 0.0});  // descriptors of its own
  for (int n = 0; n < 150; ++n)
    poster.emplace_back(uniform(1.2, 1.8), 1.6 + uniform(-0.6, 0.6), uniform(-0.5, 0.5));
  for (int n = 0; n < 10; ++n) walk.pass(points, 0.4 * n);
  for (int n = 0; n < 6; ++n) walk.pass_blindly(50.0);
  for (int n = 0; n < 5; ++n) walk.pass(elsewhere, 50.0 + 0.4 * n);
  const FrameFeatures hung = see(0, beside(1.6), poster);
  FrameFeatures& first = walk.frames[4];
  first.features.insert(first.features.end(), hung.features.begin(), hung.features.end());
  first.descriptors.insert(first.descriptors.end(), hung.descriptors.begin(),
                           hung.descriptors.end());
  const int odd = 19;
  walk.frames[18] = hung;
  walk.frames[18].node = odd;
  const VisualOdometryResult result = track(walk);
  const auto part_of = [&](int wanted) {
    for (std::size_t n = 0; n < result.parts.size(); ++n)
      if (std::binary_search(result.parts[n].begin(), result.parts[n].end(), wanted)) return n;
    return result.parts.size();
  };
  EXPECT_NE(part_of(odd), part_of(1));
  EXPECT_NE(part_of(17), part_of(1));
  EXPECT_EQ(part_of(18), part_of(20)) << "the frame before the odd one binds the one after it";
  const auto matched = libmap::verify_pairs(walk.frames, {{4, 18}}, {}, 1);
  EXPECT_EQ(matched.links.size(), 1U) << "the motion is there";
  EXPECT_FALSE(result.tried_pairs.contains({4, 18})) << "and may find a witness later";
}

// A part that begins after dark frames is joined to the others when it shows the same scene.
TEST(VisualOdometry, ALatePartJoinsTheFirst) {
  Walk walk;
  const auto points = wall(8.0);
  for (int n = 0; n < 8; ++n) walk.pass(points, 0.25 * n);
  for (int n = 0; n < 16; ++n) walk.pass(points, 5.5 - 0.25 * n);
  const VisualOdometryResult result = track(walk);
  ASSERT_EQ(result.parts.size(), 1U);
  ASSERT_EQ(result.losses.size(), 1U);
  EXPECT_EQ(result.losses[0].node, 9);
  EXPECT_EQ(result.losses[0].key_frame, 7);
  EXPECT_GT(result.losses[0].relocalized_node, 14) << "at y = 4 it begins to see what 8 has seen";
  EXPECT_LE(result.losses[0].relocalized_node, 20);
  EXPECT_LE(result.losses[0].relocalized_at, 8);
  EXPECT_EQ(result.relocalized, 1U);
  for (int node = 2; node <= 24; ++node) EXPECT_LT(error_of(walk, result, 1, node), 1e-4) << node;
}

TEST(VisualOdometry, WaysEndWithTheirSession) {
  Walk walk;
  const auto points = wall(2.0);
  for (int n = 0; n < 5; ++n) walk.pass(points, 0.3 * n);
  for (int n = 0; n < 5; ++n) walk.pass(wall(2.0, 30.0), 30.0);
  TrackingStart start;
  for (int node = 6; node <= 10; ++node) start.session[node] = 1;
  start.first[6] = beside(7.0);
  const VisualOdometryResult result = track(walk, start);
  EXPECT_EQ(result.parts.size(), 6U) << "each frame of the second session sees another wall";
  EXPECT_TRUE(result.map_from_base.at(6).isApprox(beside(7.0), 0.0));
  EXPECT_EQ(result.losses.size(), 4U) << "the first frame of a session is not lost";
  for (const libmap::FeatureLink& link : result.links) EXPECT_LE(link.link.to, 5);
}

TEST(VisualOdometry, KnownPosesStayAndGapsAreFilled) {
  Walk walk;
  const auto points = wall(3.0);
  for (int n = 0; n < 9; ++n) walk.pass(points, 0.25 * n);
  TrackingStart start;
  start.parts = {{4, 5, 8, 40}};
  for (const int node : {4, 5, 8}) start.map_from_base[node] = walk.truth.at(node);
  start.map_from_base[40] = beside(9.0);  // has no frame
  const VisualOdometryResult result = track(walk, start);
  ASSERT_EQ(result.parts.size(), 1U);
  EXPECT_EQ(result.parts[0].size(), 10U);
  for (const int node : {4, 5, 8})
    EXPECT_TRUE(result.map_from_base.at(node).isApprox(walk.truth.at(node), 0.0));
  for (const auto& [node, pose] : walk.truth)
    EXPECT_LT(libmap::step_between(pose, result.map_from_base.at(node)).norm(), 2e-5) << node;
}

TEST(VisualOdometry, IsFoundAtLaterFramesThatAreKnown) {
  Walk walk;
  const auto points = wall(2.0);
  for (int n = 0; n < 2; ++n) walk.pass(points, 0.2 * n);
  for (int n = 0; n < 6; ++n) walk.pass_blindly(0.5);
  for (int n = 0; n < 4; ++n) walk.pass(points, 0.1 + 0.2 * n);
  TrackingStart start;
  start.parts = {{9, 10, 11, 12}};
  for (const int node : start.parts[0]) start.map_from_base[node] = walk.truth.at(node);
  const VisualOdometryResult result = track(walk, start);
  EXPECT_EQ(result.parts[0], (std::vector<int>{1, 2, 9, 10, 11, 12}));
  for (const int node : {1, 2})
    EXPECT_LT(libmap::step_between(walk.truth.at(node), result.map_from_base.at(node)).norm(),
              2e-5);
}

TEST(VisualOdometry, SameForAnyNumberOfThreads) {
  Walk walk;
  const auto points = wall(5.0);
  const FeatureNoise noise{0.2, 0.002, true};
  for (int n = 0; n < 14; ++n) walk.pass(points, 0.12 * n, noise);
  for (int n = 0; n < 6; ++n) walk.pass_blindly(2.0);
  for (int n = 0; n < 5; ++n) walk.pass(points, 0.4 + 0.2 * n, noise);
  const auto text = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    const VisualOdometryResult result = track(walk);
    std::vector<libmap::PoseLink> links;
    for (const libmap::FeatureLink& link : result.links) links.push_back(link.link);
    return libmap::to_g2o(trajectory(result.map_from_base), links);
  };
  const std::string one = text(1);
  EXPECT_TRUE(one == text(2));
  EXPECT_TRUE(one == text(5));
}

TEST(VisualOdometry, NothingIsLittleWork) {
  const VisualOdometryResult nothing = track({});
  EXPECT_TRUE(nothing.map_from_base.empty());
  EXPECT_TRUE(nothing.parts.empty());
  Walk walk;
  walk.pass_blindly(0.0);
  EXPECT_EQ(track(walk).parts.size(), 1U);
}

TEST(VisualOdometry, RefusesOptionsOutOfRange) {
  const auto broken = [](auto change) {
    VisualOdometryOptions options;
    change(options);
    EXPECT_THROW(track({}, {}, options), libmap::Error);
  };
  broken([](VisualOdometryOptions& o) { o.keyframe_inliers = -1; });
  broken([](VisualOdometryOptions& o) { o.keyframe_distance_m = 0.0; });
  broken([](VisualOdometryOptions& o) { o.keyframe_angle_deg = std::nan(""); });
  broken([](VisualOdometryOptions& o) { o.relocalization_candidates = -2; });
}

// Complete refinement of a scan without poses.

}  // namespace visual_odometry_test
