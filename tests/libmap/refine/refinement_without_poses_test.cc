// Scans whose nodes have no poses or wrong poses, which are determined by images only.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/poses/trajectory_text.h"
#include "libmap/refine/initial_poses.h"
#include "libmap/refine/refinement.h"
#include "libmap/refine/visual_odometry.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"

namespace refinement_without_poses_test {

using graspmap_test::around;
using graspmap_test::beside;
using graspmap_test::boulders;
using graspmap_test::looking;
using graspmap_test::plane_z;
using graspmap_test::small_options;
using graspmap_test::TexturedScan;
using libmap::Pose;
using libmap::RefinementOptions;
using libmap::RefinementResult;
using libmap::StartPoses;
using libmap::Vector6d;

void forget_poses(TexturedScan& scan) {
  scan.graph_.links.clear();
  for (libmap::GraphNode& node : scan.graph_.nodes) node.odometry_from_base.reset();
}

TexturedScan loop_of(int frames, double step_deg = 15.0) {
  TexturedScan scan;
  for (int n = 0; n < frames; ++n)
    scan.see(boulders(), around(step_deg * n, 1.0 + 0.1 * std::sin(0.8 * n)), Vector6d::Zero());
  return scan;
}

const libmap::StageReport& stage_of(const RefinementResult& result, const std::string& name) {
  for (const libmap::StageReport& stage : result.stages)
    if (stage.name == name) return stage;
  throw std::runtime_error("no stage " + name);
}

double figure(const libmap::StageReport& stage, const std::string& name) {
  for (const auto& [known, value] : stage.metrics)
    if (known == name) return value;
  throw std::runtime_error("no figure " + name);
}

TEST(RefinementWithoutPoses, ImagesAloneGiveTheWay) {
  TexturedScan scan = loop_of(8);
  forget_poses(scan);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.poses.size(), 8U);
  EXPECT_EQ(result.stages.front().name, "start: visual");
  EXPECT_TRUE(result.warnings.empty());
  const libmap::StageReport& odometry = stage_of(result, "odometry");
  EXPECT_LT(odometry.error->absolute.rmse_m, 0.008);
  EXPECT_EQ(figure(odometry, "links"), 7.0);
  EXPECT_EQ(figure(odometry, "lost_nodes"), 0.0);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.002);
  EXPECT_EQ(result.components.size(), 1U);
  EXPECT_EQ(result.covariance.size(), 8U);
}

// Wrong poses and links have no effect with StartPoses::visual.
TEST(RefinementWithoutPoses, VisualStartHearsNoOdometry) {
  TexturedScan scan = loop_of(6);
  for (std::size_t n = 1; n < 6; ++n)
    scan.graph_.nodes[n].odometry_from_base = beside(static_cast<double>(n));
  for (libmap::PoseLink& link : scan.graph_.links) {
    link.from_from_to = beside(3.0);
    link.information *= 1e6;
  }
  RefinementOptions options = small_options();
  options.start = StartPoses::visual;
  const RefinementResult result = libmap::refine_poses(scan, options);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.002);
  EXPECT_EQ(result.links.size(), result.closures.size()) << "all were found";
  EXPECT_TRUE(result.poses.front().world_from_base.isApprox(
      *scan.graph_.nodes.front().odometry_from_base, 1e-12))
      << "the first node says where the map lies";
}

TEST(RefinementWithoutPoses, WhatNothingJoinsIsLeftOutAndNamed) {
  TexturedScan scan = loop_of(5);
  for (int n = 0; n < 3; ++n)
    scan.see(plane_z(0.0), looking({50 + 0.2 * n, 0, 1.1}, {50.4 + 0.2 * n, 0, 0}),
             Vector6d::Zero());
  scan.see(boulders(), around(200), Vector6d::Zero(), false);  // blank, far from the others
  forget_poses(scan);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.poses.size(), 5U);
  EXPECT_EQ(result.without_pose, (std::vector<int>{6, 7, 8, 9}));
  ASSERT_EQ(result.components.size(), 3U);
  EXPECT_EQ(result.components[1].nodes, (std::vector<int>{6, 7, 8}));
  ASSERT_EQ(result.losses.size(), 2U);
  EXPECT_EQ(result.losses[0].node, 6);
  EXPECT_EQ(result.losses[1].node, 9);
  ASSERT_EQ(result.warnings.size(), 2U);
  EXPECT_NE(result.warnings[0].find("node 6, "), std::string::npos);
  EXPECT_NE(result.warnings[1].find("6, 7, 8, 9"), std::string::npos);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.003);  // of the five that are left
  for (const libmap::PoseLink& link : result.links) EXPECT_LE(link.to, 5);
  EXPECT_EQ(result.covariance.size(), 5U);
}

TEST(RefinementWithoutPoses, TwoSessionsBecomeOneMap) {
  TexturedScan scan = loop_of(8);
  for (std::size_t n = 4; n < 8; ++n) scan.graph_.nodes[n].session = 1;
  forget_poses(scan);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.components.size(), 1U);
  EXPECT_EQ(result.poses.size(), 8U);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.003);
}

// Images without features are tracked by depth, from the pose by constant motion.
TEST(RefinementWithoutPoses, DepthLeadsOverBlurredImages) {
  TexturedScan scan = loop_of(10);
  for (const int node : {4, 5, 8}) {
    libmap::ColorImage& color = scan.frames.at(node).color;
    color = libmap::ColorImage(color.width, color.height, {90, 90, 90});
  }
  forget_poses(scan);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.poses.size(), 10U);
  EXPECT_GE(figure(stage_of(result, "odometry"), "tracked_by_depth"), 3.0);
  EXPECT_TRUE(result.losses.empty());
  EXPECT_EQ(result.components.size(), 1U);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.002);
}

// The camera reverses at an image without features. Constant motion from before does not predict
// its pose, but interpolation between both sides does.
TEST(RefinementWithoutPoses, DepthFindsAFrameFromBothSides) {
  TexturedScan scan;
  for (const double angle : {-15.0, 0.0, 15.0, 30.0, 15.0, 0.0, -15.0})
    scan.see(boulders(), around(angle), Vector6d::Zero(), scan.frames.size() != 4);
  forget_poses(scan);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.poses.size(), 7U);
  ASSERT_EQ(result.losses.size(), 1U);
  EXPECT_EQ(result.losses[0].node, 5);
  EXPECT_EQ(result.losses[0].relocalized_node, 5);
  EXPECT_EQ(result.losses[0].relocalized_at, 4);
  EXPECT_EQ(figure(stage_of(result, "odometry"), "tracked_by_depth"), 2.0);
  EXPECT_TRUE(result.warnings.size() == 1U) << result.warnings.back();
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.002);
}

// Two frames with a correct relative pose, but a wrong pose relative to the others.
TEST(RefinementWithoutPoses, APartIsCarriedToWhereItsDepthFits) {
  const TexturedScan scan = loop_of(7, 7.5);
  const auto frames =
      libmap::find_features(scan, {1, 2, 3, 4, 5, 6, 7}, small_options().features).frames;
  libmap::VisualOdometryResult lost;
  for (const libmap::GraphNode& node : scan.graph_.nodes)
    lost.map_from_base[node.id] = *node.truth_from_base;
  const std::map<int, Pose> truth = lost.map_from_base;
  for (const int node : {4, 5}) lost.map_from_base[node] = truth.at(5).inverse() * truth.at(node);
  lost.parts = {{1, 2, 3, 6, 7}, {4, 5}};
  lost.losses = {{.node = 4, .key_frame = 3}};
  libmap::VisualOdometryResult found = lost;
  libmap::place_lost_frames(frames, {}, {}, 1, found);
  EXPECT_EQ(found.parts, (std::vector<std::vector<int>>{{1, 2, 3, 4, 5, 6, 7}}));
  for (const auto& [node, pose] : truth)
    EXPECT_LT((found.map_from_base.at(node).translation() - pose.translation()).norm(), 0.005);
  EXPECT_EQ(found.losses[0].relocalized_node, 4);
  EXPECT_EQ(found.losses[0].relocalized_at, 3);
  EXPECT_FALSE(found.depth_links.empty());
  // Poses that are known stay.
  libmap::VisualOdometryResult kept = lost;
  libmap::TrackingStart known;
  known.map_from_base[5] = Pose::Identity();
  libmap::place_lost_frames(frames, known, {}, 1, kept);
  EXPECT_EQ(kept.parts, lost.parts);
  EXPECT_TRUE(kept.depth_links.empty());
}

// The error for a scan without poses whose frames are all broken is that of a frame.
TEST(RefinementWithoutPoses, TheFirstBrokenFrameIsNamed) {
  TexturedScan scan = loop_of(2);
  forget_poses(scan);
  for (auto& [node, frame] : scan.frames) frame.cameras.clear();
  try {
    libmap::refine_poses(scan, small_options());
    FAIL();
  } catch (const libmap::Error& error) {
    EXPECT_NE(std::string(error.what()).find("calibration"), std::string::npos) << error.what();
  }
}

// Distant frames of bare ground: neither images nor depth determine their relative pose.
TEST(RefinementWithoutPoses, WithoutTextureAndReliefThereIsNoWay) {
  TexturedScan scan;
  for (int n = 0; n < 3; ++n) {
    scan.see(boulders(), around(0), Vector6d::Zero(), false);
    if (n != 1) continue;
    libmap::DepthImage& depth = scan.frames.at(2).depth;
    for (float& meters : depth.pixels) meters = meters > 0.0F ? 1.0F : 0.0F;
  }
  forget_poses(scan);
  try {
    libmap::refine_poses(scan, small_options());
    FAIL();
  } catch (const libmap::Error& error) {
    EXPECT_EQ(error.context().field, "frames");
    EXPECT_EQ(error.context().value, "3");
  }
}

// The camera rotates by up to 100 degrees per second at 15 frames per second, with a rolling
// shutter of 20 ms. There are more frames than a calibration uses.
TEST(RefinementWithoutPoses, RollingShutterOfALongScan) {
  TexturedScan scan;
  scan.interval_s = 0.0667;
  scan.rolling_shutter_s = 0.02;
  scan.base_at = [](double time_s) {
    const Pose turned = libmap::make_pose_from_rpy(
        {0, 0, 0}, {5.0 * std::sin(9.0 * time_s), 6.0 * std::sin(11.0 * time_s + 1.0),
                    5.0 * std::sin(7.0 * time_s + 2.0)});
    return Pose(around(25.0 * time_s) * turned);
  };
  for (int n = 1; n <= 90; ++n)
    scan.see(boulders(), scan.base_at(scan.interval_s * n), Vector6d::Zero(), n != 40);
  forget_poses(scan);
  RefinementOptions options = small_options();
  options.features.max_features = 200;
  const RefinementResult result = libmap::refine_poses(scan, options);
  EXPECT_EQ(result.poses.size(), 90U);
  ASSERT_EQ(result.calibration.timing.size(), 1U);
  EXPECT_NEAR(result.calibration.timing[0].rolling_shutter_s, 0.02, 0.002);
  EXPECT_EQ(result.calibration.motion.size(), 90U);
  EXPECT_TRUE(result.calibration.intrinsics.empty()) << "nothing else is wrong";
  EXPECT_TRUE(result.calibration.depth.empty());
  // The blank image is a reason to track again.
  EXPECT_GT(stage_of(result, "tracking again").held_out.matches.count, 0U);
  // All frames are moved by their motions before surfaces are aligned.
  EXPECT_LT(stage_of(result, "calibration").error->absolute.rmse_m, 0.0015);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.001);
}

TEST(RefinementWithoutPoses, SameBytesForAnyNumberOfThreads) {
  TexturedScan scan = loop_of(5);
  forget_poses(scan);
  const auto bytes = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    const RefinementResult result = libmap::refine_poses(scan, small_options());
    return libmap::to_g2o(result.poses, result.links);
  };
  const std::string one = bytes(1);
  EXPECT_TRUE(one == bytes(3));
}

TEST(InitialPoses, LinksAloneGiveParts) {
  libmap::PoseGraph graph;
  for (const int node : {1, 2, 3, 5, 6, 9}) graph.nodes.push_back({.id = node});
  const Pose motion = beside(0.7);
  for (const auto& [from, to] : {std::pair(1, 2), {3, 2}, {5, 6}})
    graph.links.push_back(
        {from, to, libmap::LinkType::neighbor, motion, 100.0 * libmap::Matrix6d::Identity()});
  // RTAB-Map's variance of an unknown motion.
  graph.links.push_back(
      {6, 9, libmap::LinkType::neighbor, motion, libmap::Matrix6d::Identity() / 9999.0});
  const libmap::InitialPoses poses = libmap::initial_poses(graph, StartPoses::automatic);
  EXPECT_EQ(poses.source, "links");
  ASSERT_EQ(poses.parts.size(), 2U);
  EXPECT_EQ(poses.parts[0], (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(poses.parts[1], (std::vector<int>{5, 6}));
  EXPECT_EQ(poses.without_pose, std::vector<int>{9});
  EXPECT_TRUE(poses.map_from_base.at(2).isApprox(motion, 1e-12));
  EXPECT_TRUE(poses.map_from_base.at(3).isApprox(Pose(motion * motion.inverse()), 1e-12));
  const libmap::InitialPoses none = libmap::initial_poses(graph, StartPoses::visual);
  EXPECT_TRUE(none.map_from_base.empty());
  EXPECT_EQ(none.without_pose.size(), 6U);
  EXPECT_THROW(libmap::initial_poses(graph, StartPoses::odometry), libmap::Error);
  EXPECT_THROW(libmap::initial_poses(graph, StartPoses::stored), libmap::Error);
}

}  // namespace refinement_without_poses_test
