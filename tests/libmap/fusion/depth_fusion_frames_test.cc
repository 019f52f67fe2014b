// Frames of fusion: several cameras, colors of another size, frames without depth.

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string>

#include "libmap/fusion/depth_fusion.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/libmap/fusion/fusion_checks.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_fusion_frames_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::render_depth;
using graspmap_test::ring_scan;
using graspmap_test::small_camera;

TEST(DepthFusionFrames, SeveralCamerasOfOneFrameCountAsOneView) {
  // Two cameras side by side in one image, both towards the middle.
  Camera left = small_camera();
  Camera right = small_camera();
  left.base_from_camera = make_pose_from_rpy({0, 0.1, 0}, {0, 0, -5}) * optical_to_body_rotation();
  right.base_from_camera = make_pose_from_rpy({0, -0.1, 0}, {0, 0, 5}) * optical_to_body_rotation();
  const Pose base = looking({0.4, 0, 1}, {0, 0, 0});
  DepthImage both(256, 96);
  for (int part = 0; part < 2; ++part) {
    const Camera& camera = part == 0 ? left : right;
    const DepthImage one =
        render_depth(plane_z(0), camera, base * camera.base_from_camera, {}, random_engine());
    for (int y = 0; y < 96; ++y)
      for (int x = 0; x < 128; ++x) both.at(128 * part + x, y) = one.at(x, y);
  }
  MemoryScan scan;
  scan.add(left, both);
  scan.frames[1].cameras = {left, right};
  scan.poses = {{1, 0, base}};
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  EXPECT_GT(cloud.size(), 8000U);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    ASSERT_NEAR(cloud.positions[n].z(), 0, 1e-5);
    ASSERT_EQ(cloud.find_field("views")->values[n], 1);
  }
}

TEST(DepthFusionFrames, BestViewsGiveTheColor) {
  const Color green = {20, 200, 30};
  const Color red = {220, 10, 20};
  MemoryScan scan;
  const auto add = [&](const Eigen::Vector3d& eye, const Color& color) {
    scan.see(plane_z(0), looking(eye, {0, 0, 0}), small_camera(), {}, random_engine());
    scan.frames.rbegin()->second.color = ColorImage(128, 96, color);
  };
  add({0, 0.05, 0.7}, green);
  for (int n = 0; n < 3; ++n) add({2.0, 0.1 * n, 1.0}, red);
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  ASSERT_TRUE(cloud.has_colors());
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (cloud.positions[n].head<2>().norm() < 0.15) {
      EXPECT_GT(cloud.colors[n][1], 180);
      EXPECT_LT(cloud.colors[n][0], 50);
    }
  DepthFusionOptions options;
  options.color = false;
  EXPECT_FALSE(fuse_depth(scan, scan.poses, options).cloud.has_colors());
}

TEST(DepthFusionFrames, ColorImageOfAnotherSize) {
  MemoryScan scan = ring_scan(plane_z(0), 1, {});
  RgbdFrame& frame = scan.frames[1];
  // Left half blue, right half yellow, at twice the size.
  frame.color = ColorImage(256, 192, Color{0, 0, 255});
  for (int y = 0; y < 192; ++y)
    for (int x = 128; x < 256; ++x) frame.color.at(x, y) = {255, 255, 0};
  Camera color_camera = small_camera();
  color_camera.width *= 2;
  color_camera.height *= 2;
  for (double* number : {&color_camera.fx, &color_camera.fy, &color_camera.cx, &color_camera.cy})
    *number *= 2;
  frame.cameras = {color_camera};
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  const Pose base_from_world = scan.poses[0].world_from_base.inverse();
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const double left = (base_from_world * cloud.positions[n]).y();
    if (std::abs(left) < 0.03) continue;
    ASSERT_EQ(cloud.colors[n][2] > 128, left > 0);
  }
  for (const Eigen::Vector3d& point : cloud.positions) ASSERT_NEAR(point.z(), 0, 1e-4);
}

TEST(DepthFusionFrames, FramesThatCannotBeUsedAreSkippedAndNamed) {
  MemoryScan scan = ring_scan(plane_z(0), 6, {});
  scan.broken[2] = true;
  scan.frames[3].depth = {};
  scan.frames[4].depth = {};
  scan.frames[4].right = GrayImage(128, 96);
  scan.frames[5].cameras.clear();
  scan.poses[5].world_from_base.translation().x() = std::numeric_limits<double>::quiet_NaN();
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(result.frames, 1U);
  ASSERT_EQ(result.skipped.size(), 5U);
  const std::map<int, libmap::Error> faults(result.skipped.begin(), result.skipped.end());
  EXPECT_TRUE(is_error(faults.at(2), {.file = "memory.db", .field = "node 2"}));
  EXPECT_TRUE(is_error(faults.at(3), {.field = "node 3"}));
  EXPECT_TRUE(is_error(faults.at(4), {.field = "node 4", .about = "--stereo"}));
  EXPECT_TRUE(is_error(faults.at(5), {.field = "node 5"}));
  EXPECT_TRUE(is_error(faults.at(6), {.field = "node 6"}));
  DepthFusionOptions strict;
  strict.strict = true;
  for (const TrajectoryPose& pose : scan.poses) {
    if (pose.node == 1) continue;
    const Error error = error_of([&] { fuse_depth(scan, {scan.poses[0], pose}, strict); });
    EXPECT_TRUE(error.context().field.starts_with("node " + std::to_string(pose.node)))
        << error.what();
  }
}

// Counts how often the depth of a frame is read.
class CountingScan : public MemoryScan {
 public:
  explicit CountingScan(MemoryScan scan) : MemoryScan(std::move(scan)) {}
  RgbdFrame read_frame(int node, FrameParts parts) const override {
    if (parts.depth) ++depth_reads;
    return MemoryScan::read_frame(node, parts);
  }
  mutable std::atomic<int> depth_reads = 0;
};

TEST(DepthFusionFrames, EachDepthImageIsReadOnce) {
  CountingScan scan(ring_scan(plane_z(0), 6, {}));
  for (TrajectoryPose& pose : scan.poses)
    pose.world_from_base.translation().z() += pose.node % 2 == 0 ? 0.01 : -0.01;
  EXPECT_GT(fuse_depth(scan, scan.poses).registration_rounds, 0);
  EXPECT_EQ(scan.depth_reads, 6);
}

TEST(DepthFusionFrames, FramesOfAKnownSurfaceAreLeftOut) {
  MemoryScan scan;
  for (int n = 0; n < 16; ++n) {
    const bool is_last = n == 15;  // sees other ground
    const Eigen::Vector3d target(is_last ? 2.0 : 0.001 * n, 0, 0);
    scan.see(plane_z(0), looking(target + Eigen::Vector3d(0.5, 0, 1), target), small_camera(), {},
             random_engine());
  }
  DepthFusionOptions options;
  options.enough_views = 5;
  const DepthFusionResult result = fuse_depth(scan, scan.poses, options);
  EXPECT_GE(result.redundant_frames, 7U) << "five to eight are fused, and the last one";
  EXPECT_LE(result.redundant_frames, 10U);
  EXPECT_EQ(result.frames + result.redundant_frames, 16U);
  ASSERT_EQ(result.poses.size(), 16U);
  EXPECT_EQ(result.poses[12].node, scan.poses[12].node);
  EXPECT_EQ(result.poses[12].world_from_base.matrix(), scan.poses[12].world_from_base.matrix());
  bool has_last = false;
  for (const Eigen::Vector3d& point : result.cloud.positions) has_last |= point.x() > 2.0;
  EXPECT_TRUE(has_last);
  // Nearer views measure the surface more precisely.
  scan.see(plane_z(0), looking({0.1, 0, 0.2}, {0, 0, 0}), small_camera(), {}, random_engine());
  EXPECT_EQ(fuse_depth(scan, scan.poses, options).frames, result.frames + 1);
  options.enough_views = 0;
  EXPECT_EQ(fuse_depth(scan, scan.poses, options).frames, 17U);
}

// Redundant frames move with the nearest used frame.
TEST(DepthFusionFrames, PosesOfLeftOutFramesAreCorrected) {
  MemoryScan scan;
  for (int n = 0; n < 16; ++n)
    scan.see(plane_z(0), looking({0.5, 0.001 * n, 1}, {0, 0, 0}), small_camera(), {0.001, 0.001},
             random_engine());
  Trajectory given = scan.poses;
  for (TrajectoryPose& pose : given)
    pose.world_from_base.translation().z() += pose.node <= 2 ? 0.015 : -0.015;
  DepthFusionOptions options;
  options.enough_views = 4;
  const DepthFusionResult result = fuse_depth(scan, given, options);
  ASSERT_GT(result.registration_rounds, 0);
  ASSERT_GT(result.redundant_frames, 8U);
  for (std::size_t n = 5; n < 16; ++n)
    EXPECT_NEAR(result.poses[n].world_from_base.translation().z() -
                    result.poses[0].world_from_base.translation().z(),
                0.0, 0.005)
        << n;
}

TEST(DepthFusionFrames, NothingToFuse) {
  MemoryScan scan = ring_scan(plane_z(0), 2, {});
  EXPECT_TRUE(is_error(error_of([&] { fuse_depth(scan, {}); }), {.field = "poses"}));
  scan.frames[1].depth = {};
  scan.frames[2].depth = {};
  EXPECT_TRUE(is_error(error_of([&] { fuse_depth(scan, scan.poses); }), {.field = "frames"}));
  for (auto& [node, frame] : scan.frames) frame.depth = DepthImage(128, 96, 0.0F);
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_TRUE(result.cloud.empty());
  EXPECT_EQ(result.pixels.unmeasured, result.pixels.pixels);
  EXPECT_NE(result.cloud.find_field("views"), nullptr);
}

TEST(DepthFusionFrames, OptionsOutOfTheirRangesAreNamed) {
  const MemoryScan scan = ring_scan(plane_z(0), 1, {});
  const auto refused = [&](const std::function<void(DepthFusionOptions&)>& change) {
    DepthFusionOptions options;
    change(options);
    return error_of([&] { fuse_depth(scan, scan.poses, options); });
  };
  EXPECT_TRUE(is_error(refused([](auto& o) { o.voxel_size_m = 0; }),
                       {.field = "voxel_size_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.voxel_size_m = NAN; }),
                       {.field = "voxel_size_m", .value = "nan", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.planes.max_depth_m = 0.05; }),
                       {.field = "max_depth_m", .value = "0.05", .bound = "> 0.1"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.planes.radius_px = 8; }),
                       {.field = "plane_radius_px", .value = "8", .bound = ">= 1 and <= 7"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.planes.noise.axial_m = 0; }),
                       {.field = "axial_noise_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.points.min_views = 0; }),
                       {.field = "min_views", .value = "0", .bound = ">= 1"}));
  EXPECT_TRUE(is_error(refused([](auto& o) { o.voxel_size_m = 1e-7; }),
                       {.field = "voxel_size_m", .value = "1e-07"}));
  MemoryScan far = ring_scan(plane_z(0), 2, {});
  far.poses[1].world_from_base.translation().x() += 1e6;
  EXPECT_TRUE(
      is_error(error_of([&] { fuse_depth(far, far.poses); }),
               {.field = "node 2", .value = "999998.2 m from the first", .bound = "< 9437.184 m"}));
}

}  // namespace depth_fusion_frames_test
}  // namespace libmap
