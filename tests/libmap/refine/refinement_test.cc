#include "libmap/refine/refinement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "libmap/core/parallel.h"
#include "libmap/optimize/icp_refinement.h"
#include "libmap/poses/trajectory_text.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace refinement_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::looking;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_step;
using graspmap_test::small_options;
using graspmap_test::sphere;
using graspmap_test::TexturedScan;
using libmap::Pose;
using libmap::RefinementOptions;
using libmap::RefinementResult;
using libmap::Vector6d;

TexturedScan loop_of(int frames, bool textured = true) {
  TexturedScan scan;
  for (int n = 0; n < frames; ++n)
    scan.see(boulders(), around(18.0 * n, 1.0 + 0.1 * std::sin(0.8 * n)), random_step(0.015, 0.012),
             textured);
  return scan;
}

double error_of_poses(const RefinementResult& result) {
  return result.stages.back().error->absolute.rmse_m;
}

TEST(Refinement, BringsADriftingLoopToTheTruth) {
  const TexturedScan scan = loop_of(14);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_GT(result.stages.front().error->absolute.rmse_m, 0.01);
  EXPECT_LT(error_of_poses(result), 0.0015);
  EXPECT_EQ(result.poses.size(), 14U);
  EXPECT_GT(result.closures.size(), 13U);
  EXPECT_TRUE(result.warnings.empty());
  EXPECT_TRUE(result.poses.front().world_from_base.isApprox(around(0, 1.0), 1e-12))
      << "the first node stays";
  ASSERT_EQ(result.covariance.size(), 14U);
  // Stated deviations are correct within a small factor.
  const double claimed = std::sqrt(result.covariance.at(8).topLeftCorner<3, 3>().trace());
  EXPECT_GT(claimed, 5e-5);
  EXPECT_LT(claimed, 5e-3);
}

// An error of the principal point rotates all frames, so the uncertainty of poses relative to the
// first one includes that of the camera.
TEST(Refinement, DeviationsCoverAnEstimatedCamera) {
  TexturedScan scan = loop_of(14);
  const auto deviation = [](const RefinementResult& result) {
    return std::sqrt(result.covariance.at(8).topLeftCorner<3, 3>().trace());
  };
  const RefinementResult stored = libmap::refine_poses(scan, small_options());
  for (auto& [node, frame] : scan.frames)
    frame.cameras = {libmap::moved(frame.cameras[0], {0.03, 0.03, 6.0, -5.0})};
  const RefinementResult estimated = libmap::refine_poses(scan, small_options());
  ASSERT_TRUE(stored.calibration.intrinsics.empty());
  ASSERT_EQ(estimated.calibration.intrinsics.size(), 1U);
  EXPECT_GT(deviation(estimated), 1.5 * deviation(stored));
  const auto from_first = [](const Pose& first, const Pose& pose) {
    return Pose(first.inverse() * pose);
  };
  for (const libmap::TrajectoryPose& pose : estimated.poses) {
    if (pose.node == 1) continue;
    const Vector6d error = libmap::step_between(
        from_first(*scan.graph_.nodes[0].truth_from_base,
                   *scan.graph_.nodes[static_cast<std::size_t>(pose.node - 1)].truth_from_base),
        from_first(estimated.poses[0].world_from_base, pose.world_from_base));
    const Eigen::Matrix3d covariance = estimated.covariance.at(pose.node).topLeftCorner<3, 3>();
    EXPECT_LT(error.head<3>().dot(covariance.ldlt().solve(error.head<3>())), 16.3)
        << "chi-square of three, one in a thousand: node " << pose.node;
  }
}

TEST(Refinement, SameBytesForAnyNumberOfThreads) {
  const TexturedScan scan = loop_of(6);
  const auto bytes = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    const RefinementResult result = libmap::refine_poses(scan, small_options());
    return libmap::to_g2o(result.poses, result.links);
  };
  const std::string one = bytes(1);
  EXPECT_TRUE(one == bytes(3));
  EXPECT_TRUE(one == bytes(1));
}

TEST(Refinement, TurningTheInputTurnsTheOutput) {
  const TexturedScan scan = loop_of(5);
  TexturedScan turned = scan;
  const Pose turn = libmap::make_pose_from_rpy({4, -1, 2}, {30, 50, -110});
  for (libmap::GraphNode& node : turned.graph_.nodes)
    node.odometry_from_base = turn * *node.odometry_from_base;
  const RefinementResult one = libmap::refine_poses(scan, small_options());
  const RefinementResult other = libmap::refine_poses(turned, small_options());
  for (std::size_t n = 0; n < one.poses.size(); ++n)
    EXPECT_LT(
        libmap::step_between(turn * one.poses[n].world_from_base, other.poses[n].world_from_base)
            .norm(),
        1e-5);
}

TEST(Refinement, WithoutTextureReliefLinksFramesByDepth) {
  const TexturedScan scan = loop_of(5, false);
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_GE(result.closures.size(), 4U);
  ASSERT_TRUE(result.stages.front().error && result.stages.back().error);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m,
            0.2 * result.stages.front().error->absolute.rmse_m);
}

TEST(Refinement, WithoutTextureAndReliefThePosesStayAndItSaysSo) {
  TexturedScan scan;
  for (int n = 0; n < 4; ++n)
    scan.see(graspmap_test::plane_z(0.0), around(10.0 * n),
             n == 0 ? Vector6d::Zero() : graspmap_test::random_step(0.02, 0.01), false);
  libmap::RefinementOptions options = small_options();
  options.icp.mode = libmap::IcpMode::off;
  const RefinementResult result = libmap::refine_poses(scan, options);
  ASSERT_EQ(result.warnings.size(), 1U);
  EXPECT_TRUE(result.closures.empty());
  for (std::size_t n = 0; n < result.poses.size(); ++n)
    EXPECT_TRUE(
        result.poses[n].world_from_base.isApprox(*scan.graph_.nodes[n].odometry_from_base, 1e-9));
}

// Two identical patches of ground, five meters apart. Their frames match perfectly; only the poses
// between them distinguish the patches.
std::string convention_warning(const TexturedScan& scan) {
  libmap::RefinementOptions options = small_options();
  options.start = libmap::StartPoses::odometry;
  options.bundle = false;
  options.rounds = 0;
  options.icp.mode = libmap::IcpMode::off;
  for (const std::string& warning : libmap::refine_poses(scan, options).warnings)
    if (warning.starts_with("initial poses: ")) return warning;
  return {};
}

// Right poses, quaternions as w x y z, and depth in a unit that is five times too small.
TEST(Refinement, WrongConventionsOfPosesAndDepthAreNamed) {
  TexturedScan scan;
  for (int n = 0; n < 8; ++n)
    scan.see(boulders(), around(15.0 * n, 1.0 + 0.03 * n), libmap::Vector6d::Zero());
  EXPECT_EQ(convention_warning(scan), "");
  TexturedScan turned = scan;
  for (libmap::GraphNode& node : turned.graph_.nodes) {
    const Eigen::Quaterniond q(node.odometry_from_base->linear());
    node.odometry_from_base->linear() =
        Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
  }
  EXPECT_NE(convention_warning(turned).find("--poses-quaternion wxyz"), std::string::npos);
  TexturedScan small = scan;
  for (auto& [node, frame] : small.frames)
    for (float& depth : frame.depth.pixels) depth *= 0.2F;
  EXPECT_NE(convention_warning(small).find("depth times 5"), std::string::npos);
}

TEST(Refinement, SameLookAtAnotherPlaceIsNotTheSamePlace) {
  TexturedScan scan;
  for (int n = 0; n < 20; ++n)
    scan.see(plane_z(0.0), looking({0.3 * n, 0.02 * (n % 3), 1.1}, {0.3 * n + 0.5, 0, 0}),
             random_step(0.002, 0.001));
  for (const int copy : {18, 19}) scan.frames.at(copy).color = scan.frames.at(copy - 16).color;
  for (const int copy : {18, 19}) scan.frames.at(copy).depth = scan.frames.at(copy - 16).depth;
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  std::size_t against = 0;
  for (const auto& stage : result.stages) against += stage.closures.against_graph;
  EXPECT_GE(against, 2U);
  for (const libmap::PoseLink& link : result.closures)
    EXPECT_FALSE(link.from <= 4 && link.to >= 17) << link.from << " " << link.to;
  EXPECT_LT((result.poses[19].world_from_base.translation() -
             result.poses[2].world_from_base.translation())
                    .norm() -
                5.1,
            0.1);
}

TEST(Refinement, SessionsAreJoinedWhereTheySeeTheSame) {
  TexturedScan scan = loop_of(8);
  const Pose elsewhere = libmap::make_pose_from_rpy({20, 5, 0}, {0, 0, 70});
  for (std::size_t n = 4; n < 8; ++n) {
    scan.graph_.nodes[n].session = 1;
    scan.graph_.nodes[n].odometry_from_base = elsewhere * *scan.graph_.nodes[n].odometry_from_base;
  }
  std::erase_if(scan.graph_.links, [](const libmap::PoseLink& link) { return link.from == 4; });
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.components.size(), 1U);
  EXPECT_LT(error_of_poses(result), 0.003);
}

TEST(Refinement, NullPosesComeFromLinksOrImagesAndTheRestIsNamed) {
  TexturedScan scan = loop_of(6);
  scan.graph_.nodes[2].odometry_from_base.reset();
  for (const int id : {7, 8}) {
    libmap::GraphNode lost;
    lost.id = id;
    scan.graph_.nodes.push_back(lost);
    scan.frames[id] = scan.frames[6];
  }
  scan.frames[8].color =
      libmap::ColorImage(scan.frames[6].color.width, scan.frames[6].color.height, {90, 90, 90});
  for (float& meters : scan.frames[8].depth.pixels) meters = meters > 0.0F ? 1.0F : 0.0F;
  const RefinementResult result = libmap::refine_poses(scan, small_options());
  EXPECT_EQ(result.poses.size(), 7U);
  EXPECT_LT(
      libmap::step_between(result.poses[5].world_from_base, result.poses[6].world_from_base).norm(),
      1e-4);
  EXPECT_EQ(result.without_pose, std::vector<int>{8});
  EXPECT_LT(error_of_poses(result), 0.002);
  RefinementOptions stored = small_options();
  stored.start = libmap::StartPoses::odometry;
  const RefinementResult without = libmap::refine_poses(scan, stored);
  EXPECT_EQ(without.poses.size(), 6U);
  EXPECT_EQ(without.without_pose, (std::vector<int>{7, 8}));
}

// Ground with texture-free relief: frames determine each other only perpendicular to it.
TEST(IcpRefinement, PlanesDoNotSlide) {
  TexturedScan scan;
  const Pose first = looking({0, 0, 1.2}, {0.4, 0, 0});
  const Pose second = looking({-0.2, 0.13, 1.1}, {0.35, 0.1, 0});
  scan.see(plane_z(0.0), first, Vector6d::Zero(), false);
  scan.see(plane_z(0.0), second, Vector6d::Zero(), false);
  const auto found = libmap::find_features(scan, {1, 2}, {});
  Vector6d away;
  away << 0.004, 0.003, 0.002, 0.002, -0.003, 0.002;
  const std::map<int, Pose> start = {{1, first}, {2, libmap::moved(second, away)}};
  libmap::BlockSystem prior(2);  // the pose is known to 3 mm and 3 mrad
  prior.add(1, 1, 1e5 * libmap::Matrix6d::Identity());
  const auto aligned = libmap::align_surfaces(found.frames, start, prior, {{{1, 2}, 1}}, {}, {});
  EXPECT_EQ(aligned.pairs, 1U);
  // Height and tilt are found; place and turn in the plane stay where they were.
  const Pose& pose = aligned.map_from_base.at(2);
  EXPECT_LT(std::abs((pose.translation() - second.translation()).z()), 5e-4);
  EXPECT_LT((pose.linear().row(2) - second.linear().row(2)).norm(), 5e-4);
  EXPECT_GT(std::abs((start.at(2).translation() - second.translation()).z()), 1e-3);
  EXPECT_LT((pose.translation() - start.at(2).translation()).head<2>().norm(), 1e-3);
}

TEST(IcpRefinement, ReliefBringsFramesTogether) {
  TexturedScan scan;
  for (int n = 0; n < 3; ++n) scan.see(boulders(), around(12.0 * n), Vector6d::Zero(), false);
  const auto found = libmap::find_features(scan, {1, 2, 3}, {});
  std::map<int, Pose> start;
  for (int n = 0; n < 3; ++n)
    start[n + 1] = n == 0 ? around(0) : libmap::moved(around(12.0 * n), random_step(0.005, 0.004));
  libmap::BlockSystem prior(3);  // as if each pose were known by 3 cm
  for (std::size_t n = 0; n < 3; ++n) prior.add(n, n, 1e3 * libmap::Matrix6d::Identity());
  const auto aligned = libmap::align_surfaces(found.frames, start, prior, {{{1, 2, 3}, 1}}, {}, {});
  for (int n = 1; n < 3; ++n) {
    const Vector6d error = libmap::step_between(around(12.0 * n), aligned.map_from_base.at(n + 1));
    EXPECT_LT(error.head<3>().norm(), 1.2e-3);
    EXPECT_LT(error.tail<3>().norm(), 1e-3);
  }
}

double stated_scale(const std::function<double(double, double)>& bend, double prior_error_m) {
  TexturedScan scan;
  std::map<int, Pose> start;
  std::vector<int> nodes;
  for (int n = 0; n < 5; ++n) {
    scan.see(boulders(), around(14.0 * n), Vector6d::Zero(), false);
    libmap::DepthImage& depth = scan.frames.at(n + 1).depth;
    for (std::size_t p = 0; p < depth.pixels.size(); ++p)
      if (depth.pixels[p] > 0.0F)
        depth.pixels[p] += static_cast<float>(
            bend(static_cast<double>(p % 256), static_cast<double>(depth.pixels[p])));
    start[n + 1] = around(14.0 * n);
    if (n > 0) start[n + 1].translation().z() += n % 2 == 0 ? prior_error_m : -prior_error_m;
    nodes.push_back(n + 1);
  }
  const auto found = libmap::find_features(scan, nodes, {});
  libmap::BlockSystem prior(5);  // poses are known to 1 mm and 1 mrad
  for (std::size_t n = 0; n < 5; ++n) prior.add(n, n, 1e6 * libmap::Matrix6d::Identity());
  return libmap::align_surfaces(found.frames, start, prior, {{nodes, 1}}, {}, {}).deviation_scale;
}

// Stated deviations grow with the correlation of depth errors between neighboring pixels, and with
// the contradiction between surfaces and prior.
TEST(IcpRefinement, DeviationsGrowWhereResidualsDependOnEachOtherOrContradictThePrior) {
  const auto nothing = [](double, double) { return 0.0; };
  const double clean = stated_scale(nothing, 0.0);
  EXPECT_LT(clean, 1.5);
  const auto bent = [](double column, double z) {
    return 0.006 * std::sin(0.05 * column) + 0.004 * std::sin(9.0 * z);
  };
  EXPECT_GT(stated_scale(bent, 0.0), 2.0 * clean);
  EXPECT_GT(stated_scale(nothing, 0.006), 2.0 * clean);
}

TEST(IcpRefinement, DepthAloneTellsTheMotionOfAPair) {
  TexturedScan scan;
  scan.see(boulders(), around(0), Vector6d::Zero(), false);
  scan.see(boulders(), around(12), Vector6d::Zero(), false);
  scan.see(plane_z(0.0), looking({0.8, 0, 1.1}, {0.0, 0, 0}), Vector6d::Zero(), false);
  const auto found = libmap::find_features(scan, {1, 2, 3}, {});
  const Pose truth = around(0).inverse() * around(12);
  Vector6d away;
  away << 0.01, -0.01, 0.01, 0.01, 0.01, -0.01;
  const auto link =
      libmap::align_pair(found.frames[0], found.frames[1], libmap::moved(truth, away));
  ASSERT_TRUE(link);
  EXPECT_EQ(link->from, 1);
  EXPECT_EQ(link->to, 2);
  // The pose is found perpendicular to the ground; around the boulders it remains near the guess,
  // with a large deviation.
  const Vector6d error = libmap::step_between(truth, link->from_from_to);
  EXPECT_LT(std::abs(error[0]) + std::abs(error[2]), 0.01);
  EXPECT_LT(std::abs(error[4]), 2e-3);
  EXPECT_LT(error.dot(link->information * error) / 6.0, 9.0);
  EXPECT_FALSE(libmap::align_pair(found.frames[0], found.frames[2], truth)) << "another place";
}

// From guesses that are 5 cm or 3 degrees away.
TEST(IcpRefinement, DepthAloneTellsTheMotionOfAPairFromAfar) {
  TexturedScan scan;
  const auto rough = nearest_of({plane_z(0.0), sphere({0.1, 0.2, 0.05}, 0.2),
                                 sphere({-0.3, -0.2, 0.0}, 0.15), sphere({0.4, -0.3, -0.05}, 0.25),
                                 sphere({0.3, 0.5, 0.0}, 0.15), sphere({-0.2, 0.3, 0.0}, 0.2)});
  scan.see(rough, around(0), Vector6d::Zero(), false);
  scan.see(rough, around(8), Vector6d::Zero(), false);
  const auto found = libmap::find_features(scan, {1, 2}, {});
  const Pose truth = around(0).inverse() * around(8);
  for (int axis = 0; axis < 6; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      const Vector6d away = sign * 0.05 * Vector6d::Unit(axis);
      const auto link =
          libmap::align_pair(found.frames[0], found.frames[1], libmap::moved(truth, away));
      ASSERT_TRUE(link) << axis;
      const Vector6d error = libmap::step_between(truth, link->from_from_to);
      EXPECT_LT(error.head<3>().norm(), 0.003) << axis << " " << sign;
      EXPECT_LT(error.tail<3>().norm(), 0.003) << axis << " " << sign;
    }
}

TEST(IcpRefinement, WantsABlockOfThePriorForEachPose) {
  const libmap::Error error = graspmap_test::error_of([] {
    libmap::align_surfaces({}, {{1, Pose::Identity()}}, libmap::BlockSystem(3), {}, {});
  });
  EXPECT_EQ(error.context().field, "blocks of the prior");
  EXPECT_EQ(error.context().value, "3");
  EXPECT_EQ(error.context().bound, "1");
}

TEST(Features, OptionsOutOfTheirRangesAreNamed) {
  const auto refusal = [](auto change) {
    libmap::FeatureOptions options;
    change(options);
    return graspmap_test::error_of([&] { libmap::find_features(TexturedScan(), {}, options); });
  };
  EXPECT_TRUE(graspmap_test::is_error(
      refusal([](auto& o) { o.max_features = 0; }),
      {.field = "max_features", .value = "0", .bound = ">= 1 and <= 1e+05"}));
  EXPECT_TRUE(graspmap_test::is_error(refusal([](auto& o) { o.pixel_noise_px = 0.0; }),
                                      {.field = "pixel_noise_px", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      graspmap_test::is_error(refusal([](auto& o) { o.planes.max_depth_m = o.planes.min_depth_m; }),
                              {.field = "max_depth_m"}));
}

// OpenCV 4.6 shifts SIFT features by a quarter of a pixel; this is corrected.
TEST(Features, SurfacesOfLongScansFitTheirMemory) {
  const libmap::Camera camera{.width = 512, .height = 424, .fx = 365, .fy = 365};
  libmap::FeatureOptions options;
  EXPECT_EQ(libmap::surface_step(60, {camera}, options), 3);
  const int step = libmap::surface_step(3000, {camera}, options);
  EXPECT_EQ(step, 5);
  EXPECT_GE(libmap::surface_step(3000, {camera, camera}, options), 7);
  EXPECT_EQ(libmap::surface_step(100'000'000, {camera}, options), 32);
  EXPECT_EQ(libmap::surface_step(3000, {}, options), 3);
}

TEST(Features, StandWhereTheBlobsAre) {
  TexturedScan scan;
  scan.see(plane_z(0.0), looking({0, 0, 1.2}, {0.6, 0, 0}), Vector6d::Zero(), false, {});
  libmap::ColorImage& color = scan.frames.at(1).color;
  std::vector<Eigen::Vector2d> centers;
  for (int row = 1; row < 6; ++row)
    for (int column = 1; column < 8; ++column)
      centers.emplace_back(32.0 * column + 0.37 * (row % 3), 30.0 * row + 0.41 * (column % 3));
  for (int y = 0; y < color.height; ++y)
    for (int x = 0; x < color.width; ++x) {
      double value = 60.0;
      for (const Eigen::Vector2d& center : centers)
        value += 150.0 * std::exp(-(Eigen::Vector2d(x, y) - center).squaredNorm() / 18.0);
      const auto gray = static_cast<std::uint8_t>(std::lround(value));
      color.at(x, y) = {gray, gray, gray};
    }
  const auto found = libmap::find_features(scan, {1}, {});
  ASSERT_EQ(found.frames.size(), 1U);
  const libmap::Camera camera = graspmap_test::textured_camera();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double count = 0.0;
  for (const libmap::Feature& feature : found.frames[0].features) {
    const Eigen::Vector2d pixel = libmap::distort_to_pixel(camera, feature.ray.cast<double>());
    for (const Eigen::Vector2d& center : centers)
      if ((pixel - center).norm() < 1.0) {
        mean += pixel - center;
        count += 1.0;
      }
    // On the plane z = 0, whose depth they know.
    const Eigen::Vector3d in_world =
        *scan.graph_.nodes[0].truth_from_base *
        (camera.base_from_camera *
         (static_cast<double>(feature.depth_m) * feature.ray.cast<double>().homogeneous()));
    EXPECT_LT(std::abs(in_world.z()), 1e-3);
  }
  ASSERT_GT(count, 20.0);
  EXPECT_LT((mean / count).norm(), 0.05);
}

TEST(PlaceRecognition, FramesOfOnePlaceLookAlike) {
  TexturedScan scan;
  for (int n = 0; n < 6; ++n)
    scan.see(plane_z(0.0), looking({3.0 * (n % 3), 0.05 * n, 1.1}, {3.0 * (n % 3) + 0.5, 0, 0}),
             Vector6d::Zero());
  const auto found = libmap::find_features(scan, {1, 2, 3, 4, 5, 6}, {});
  const auto similar = libmap::find_similar_frames(found.frames, 1, {.words = 128}, 1);
  for (std::size_t n = 0; n < 6; ++n) {
    ASSERT_EQ(similar[n].size(), 1U);
    EXPECT_EQ(similar[n][0].frame, (n + 3) % 6);
  }
}

}  // namespace refinement_test
