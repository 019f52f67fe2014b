#include "libmap/cloud/depth_fusion.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/libmap/cloud/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace {

using graspmap_test::box;
using graspmap_test::DepthNoiseModel;
using graspmap_test::error_of;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::render_depth;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using graspmap_test::Surface;
using graspmap_test::uniform;
using ::testing::HasSubstr;

constexpr DepthNoiseModel kinect{0.002, 0.005};

// Views from a ring above the ground, all towards `target`.
MemoryScan ring_scan(const Surface& surface, int views, const DepthNoiseModel& noise,
                     const Eigen::Vector3d& target = Eigen::Vector3d::Zero(), double radius_m = 0.9,
                     double height_m = 1.0) {
  MemoryScan scan;
  for (int n = 0; n < views; ++n) {
    const double angle = 2 * std::numbers::pi * n / views + 0.1;
    const Eigen::Vector3d eye(radius_m * std::cos(angle), radius_m * std::sin(angle), height_m);
    scan.see(surface, looking(target + eye, target), small_camera(), noise, random_engine());
  }
  return scan;
}

double rms(const std::vector<double>& values) {
  double squares = 0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

// Heights of the points that lie within 0.3 m of the z axis.
std::vector<double> heights_of(const PointCloud& cloud) {
  std::vector<double> heights;
  for (const Eigen::Vector3d& point : cloud.positions)
    if (point.head<2>().norm() < 0.3) heights.push_back(point.z());
  return heights;
}

TEST(DepthFusion, PlaneOfOneFrame) {
  // Near enough that pixels lie closer than voxels.
  const MemoryScan scan = ring_scan(plane_z(0), 1, {}, Eigen::Vector3d::Zero(), 0.5, 0.6);
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(result.frames, 1U);
  EXPECT_GT(result.cloud.size(), 4000U);
  result.cloud.check();
  for (std::size_t n = 0; n < result.cloud.size(); ++n) {
    ASSERT_NEAR(result.cloud.positions[n].z(), 0, 1e-5);
    ASSERT_GT(result.cloud.normals[n].z(), 0.9999F);
    ASSERT_EQ(result.cloud.find_field("views")->values[n], 1);
  }
  // One point a voxel column, and none is missing around the middle.
  std::set<std::pair<int, int>> columns;
  for (const Eigen::Vector3d& point : result.cloud.positions)
    EXPECT_TRUE(columns
                    .insert({static_cast<int>(std::floor(point.x() / 0.01)),
                             static_cast<int>(std::floor(point.y() / 0.01))})
                    .second);
  for (int x = -20; x < 20; ++x)
    for (int y = -20; y < 20; ++y) EXPECT_TRUE(columns.count({x, y}) > 0) << x << " " << y;
}

TEST(DepthFusion, ErrorFallsWithTheRootOfTheViewsAndIsForetold) {
  double last = 0;
  for (const int views : {3, 12, 48}) {
    const MemoryScan scan = ring_scan(plane_z(0), views, kinect);
    const DepthFusionResult result = fuse_depth(scan, scan.poses);
    const std::vector<double> heights = heights_of(result.cloud);
    ASSERT_GT(heights.size(), 2000U);
    const double error = rms(heights);
    if (last > 0) {
      EXPECT_NEAR(last / error, 2.0, 0.3) << views;
    }
    last = error;
    std::vector<double> in_sigmas;
    for (std::size_t n = 0; n < result.cloud.size(); ++n)
      if (result.cloud.positions[n].head<2>().norm() < 0.3)
        in_sigmas.push_back(result.cloud.positions[n].z() /
                            result.cloud.find_field("expected_error")->values[n]);
    EXPECT_GT(rms(in_sigmas), 0.6) << views;
    EXPECT_LT(rms(in_sigmas), 1.3) << views;
  }
  EXPECT_LT(last, 0.0007);
}

TEST(DepthFusion, NoBiasOnASlantedPlane) {
  // Averaged where noise has put them, measurements at the far end would win or lose.
  const MemoryScan scan = ring_scan(plane_z(0), 24, kinect, Eigen::Vector3d::Zero(), 1.6, 0.6);
  const std::vector<double> heights = heights_of(fuse_depth(scan, scan.poses).cloud);
  double mean = 0;
  for (const double height : heights) mean += height / static_cast<double>(heights.size());
  EXPECT_LT(std::abs(mean), 0.0002);
}

TEST(DepthFusion, SphereFromAllAround) {
  const Eigen::Vector3d centre(0.02, -0.03, 0.4);
  MemoryScan scan;
  for (int n = 0; n < 24; ++n) {
    // Fibonacci's spiral.
    const double z = 1 - 2 * (n + 0.5) / 24;
    const double angle = 2.399963 * n;
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d eye(r * std::cos(angle), r * std::sin(angle), z);
    scan.see(sphere(centre, 0.25), looking(centre + 1.1 * eye, centre), small_camera(), kinect,
             random_engine());
  }
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  EXPECT_GT(cloud.size(), 6000U);
  std::vector<double> errors;
  double mean = 0;
  std::size_t well_turned = 0;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d arm = cloud.positions[n] - centre;
    errors.push_back(arm.norm() - 0.25);
    mean += errors.back();
    const double turn = arm.normalized().dot(cloud.normals[n].cast<double>());
    EXPECT_GT(turn, 0) << "a normal points away from the cameras";
    well_turned += turn > 0.99 ? 1 : 0;
  }
  EXPECT_LT(rms(errors), 0.002);
  EXPECT_LT(std::abs(mean) / static_cast<double>(cloud.size()), 0.0005);
  EXPECT_GT(well_turned, cloud.size() * 95 / 100);
}

TEST(DepthFusion, SidesOfAThinPlateStayApart) {
  // 2 cm thick, and 4 mm: both sides in one voxel.
  for (const double half : {0.010, 0.002}) {
    const double middle = 0.005;
    const Surface plate = box({-0.3, -0.3, middle - half}, {0.3, 0.3, middle + half});
    MemoryScan scan;
    for (int n = 0; n < 32; ++n) {
      const double angle = 2 * std::numbers::pi * n / 32;
      const Eigen::Vector3d eye(0.5 * std::cos(angle), 0.5 * std::sin(angle), n % 2 == 0 ? 1 : -1);
      scan.see(plate, looking(eye, {0, 0, 0}), small_camera(), kinect, random_engine());
    }
    const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
    std::vector<double> errors;
    std::size_t above = 0;
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      const Eigen::Vector3d& point = cloud.positions[n];
      if (point.head<2>().cwiseAbs().maxCoeff() > 0.25) continue;
      const double side = cloud.normals[n].z() > 0 ? 1 : -1;
      errors.push_back(point.z() - middle - half * side);
      above += side > 0 ? 1 : 0;
    }
    EXPECT_GT(errors.size(), 4500U) << half;
    EXPECT_LT(rms(errors), 0.001) << half;
    EXPECT_NEAR(static_cast<double>(above) / static_cast<double>(errors.size()), 0.5, 0.05) << half;
  }
}

// Ground with a box of 15 cm on it; the true distance from both.
const Surface step_scene = nearest_of({plane_z(0), box({-0.2, -0.2, -0.1}, {0.2, 0.2, 0.15})});
double distance_from_step(const Eigen::Vector3d& p) {
  const Eigen::Vector2d beyond = p.head<2>().cwiseAbs() - Eigen::Vector2d(0.2, 0.2);
  const double outside = beyond.cwiseMax(0).norm();
  const double wall = beyond.maxCoeff();
  if (wall > 0) {
    const double side = std::hypot(outside, std::max(0.0, p.z() - 0.15));
    return std::min(std::abs(p.z()), side);
  }
  return std::min(std::abs(p.z() - 0.15), p.z() < 0.15 ? -wall : 1.0);
}

TEST(DepthFusion, StepIsNotSmeared) {
  const MemoryScan scan = ring_scan(step_scene, 24, kinect);
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  std::vector<double> errors;
  for (const Eigen::Vector3d& point : cloud.positions)
    if (point.head<2>().norm() < 0.4) errors.push_back(distance_from_step(point));
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(rms(errors), 0.0025);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.005);
  EXPECT_LT(errors.back(), 0.025);
  // Normals of the top keep to it up to its edge.
  std::size_t top = 0;
  std::size_t upright = 0;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const double inward = 0.2 - cloud.positions[n].head<2>().cwiseAbs().maxCoeff();
    if (inward < 0.008 || inward > 0.02 || std::abs(cloud.positions[n].z() - 0.15) > 0.003)
      continue;
    ++top;
    upright += cloud.normals[n].z() > 0.966F ? 1 : 0;  // 15 degrees
  }
  EXPECT_GT(top, 100U);
  EXPECT_GT(upright, top * 9 / 10);
}

TEST(DepthFusion, FlyingPixelsMakeNoPoints) {
  MemoryScan scan = ring_scan(plane_z(0), 8, kinect);
  std::size_t flying = 0;
  for (auto& [node, frame] : scan.frames)
    for (float& z : frame.depth.pixels)
      if (uniform(0, 1) < 0.02) {
        z *= static_cast<float>(uniform(0.4, 0.9));
        ++flying;
      }
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_GT(result.pixels.flying, flying * 8 / 10);
  std::size_t off = 0;
  for (const Eigen::Vector3d& point : result.cloud.positions) off += std::abs(point.z()) > 0.03;
  EXPECT_LE(off, result.cloud.size() / 1000);
  EXPECT_LT(rms(heights_of(result.cloud)), 0.003);
}

// One frame of twelve sees a plate that the others see through.
MemoryScan visited_scan() {
  MemoryScan scan = ring_scan(plane_z(0), 11, {});
  scan.see(nearest_of({plane_z(0), box({-0.1, -0.1, 0.4}, {0.1, 0.1, 0.42})}),
           looking({0.3, 0, 1.2}, {0, 0, 0}), small_camera(), {}, random_engine());
  return scan;
}
std::size_t points_above(const PointCloud& cloud, double z) {
  return static_cast<std::size_t>(
      std::count_if(cloud.positions.begin(), cloud.positions.end(),
                    [&](const Eigen::Vector3d& point) { return point.z() > z; }));
}

TEST(DepthFusion, WhatOthersSeeThroughIsDropped) {
  const MemoryScan scan = visited_scan();
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(points_above(result.cloud, 0.1), 0U);
  EXPECT_GT(result.points.seen_through, 200U);
  DepthFusionOptions options;
  options.max_seen_through = 1000;
  EXPECT_GT(points_above(fuse_depth(scan, scan.poses, options).cloud, 0.1), 200U);
  options.min_views = 2;
  const DepthFusionResult confirmed = fuse_depth(scan, scan.poses, options);
  EXPECT_EQ(points_above(confirmed.cloud, 0.1), 0U);
  EXPECT_GT(confirmed.points.unconfirmed, 200U);
}

TEST(DepthFusion, SameBytesForAnyNumberOfThreads) {
  const MemoryScan scan = ring_scan(step_scene, 11, kinect);
  std::vector<PointCloud> clouds;
  for (const unsigned threads : {1U, 2U, 8U}) {
    const ThreadLimit limit(threads);
    clouds.push_back(fuse_depth(scan, scan.poses).cloud);
  }
  for (const PointCloud& cloud : clouds) {
    EXPECT_EQ(cloud.positions, clouds[0].positions);
    EXPECT_EQ(cloud.normals, clouds[0].normals);
    EXPECT_EQ(cloud.fields, clouds[0].fields);
  }
}

TEST(DepthFusion, OrderOfThePosesDoesNotMatter) {
  const MemoryScan scan = ring_scan(step_scene, 6, kinect);
  Trajectory shuffled = scan.poses;
  std::reverse(shuffled.begin() + 1, shuffled.end());
  const PointCloud a = fuse_depth(scan, scan.poses).cloud;
  const PointCloud b = fuse_depth(scan, shuffled).cloud;
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.fields, b.fields);
}

TEST(DepthFusion, OrderOfTheNodesChangesNoMoreThanRounding) {
  MemoryScan scan = ring_scan(plane_z(0), 6, kinect);
  MemoryScan renamed;
  for (const TrajectoryPose& pose : scan.poses) {
    const int node = 7 - pose.node;
    renamed.frames[node] = scan.frames[pose.node];
    renamed.poses.push_back({node, 0, pose.world_from_base});
  }
  const std::vector<double> a = heights_of(fuse_depth(scan, scan.poses).cloud);
  const std::vector<double> b = heights_of(fuse_depth(renamed, renamed.poses).cloud);
  EXPECT_NEAR(static_cast<double>(a.size()), static_cast<double>(b.size()),
              0.002 * static_cast<double>(a.size()));
  EXPECT_NEAR(rms(a), rms(b), 0.01 * rms(a));
}

TEST(DepthFusion, OneKilometreAway) {
  const MemoryScan scan = ring_scan(step_scene, 8, kinect);
  const Eigen::Vector3d offset(1000, -2000, 300);  // whole voxels
  Trajectory moved = scan.poses;
  for (TrajectoryPose& pose : moved) pose.world_from_base.translation() += offset;
  const PointCloud here = fuse_depth(scan, scan.poses).cloud;
  const PointCloud there = fuse_depth(scan, moved).cloud;
  ASSERT_NEAR(static_cast<double>(here.size()), static_cast<double>(there.size()),
              0.002 * static_cast<double>(here.size()));
  std::vector<double> a;
  std::vector<double> b;
  for (const Eigen::Vector3d& point : here.positions)
    if (point.head<2>().norm() < 0.4) a.push_back(distance_from_step(point));
  for (const Eigen::Vector3d& point : there.positions)
    if ((point - offset).head<2>().norm() < 0.4) b.push_back(distance_from_step(point - offset));
  EXPECT_NEAR(rms(a), rms(b), 0.02 * rms(a));
}

TEST(DepthFusion, DistortedLens) {
  Camera camera = small_camera();
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {-0.25, 0.08, 0.003, -0.002};
  MemoryScan scan;
  for (int n = 0; n < 6; ++n)
    scan.see(step_scene, looking({0.7 * std::cos(n), 0.7 * std::sin(n), 1}, {0, 0, 0}), camera, {},
             random_engine());
  std::vector<double> errors;
  for (const Eigen::Vector3d& point : fuse_depth(scan, scan.poses).cloud.positions)
    if (point.head<2>().norm() < 0.4) errors.push_back(distance_from_step(point));
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 1e-4);
  EXPECT_LT(rms(errors), 0.0025);
}

TEST(DepthFusion, SeveralCamerasOfOneFrameCountAsOneView) {
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

TEST(DepthFusion, BestViewsGiveTheColour) {
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

TEST(DepthFusion, ColourImageOfAnotherSize) {
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

TEST(DepthFusion, FramesThatCannotBeUsedAreSkippedAndNamed) {
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
  std::map<int, std::string> faults(result.skipped.begin(), result.skipped.end());
  EXPECT_THAT(faults.at(2), HasSubstr("ends too early"));
  EXPECT_THAT(faults.at(3), HasSubstr("node 3: it has no depth"));
  EXPECT_THAT(faults.at(4), HasSubstr("stereo"));
  EXPECT_THAT(faults.at(5), HasSubstr("calibration"));
  EXPECT_THAT(faults.at(6), HasSubstr("not finite"));
  DepthFusionOptions strict;
  strict.strict = true;
  for (const TrajectoryPose& pose : scan.poses) {
    if (pose.node == 1) continue;
    const Error error = error_of([&] { fuse_depth(scan, {scan.poses[0], pose}, strict); });
    EXPECT_THAT(error.what(), HasSubstr("node " + std::to_string(pose.node)));
  }
}

TEST(DepthFusion, NothingToFuse) {
  MemoryScan scan = ring_scan(plane_z(0), 2, {});
  EXPECT_THAT(error_of([&] { fuse_depth(scan, {}); }).what(), HasSubstr("no poses"));
  scan.frames[1].depth = {};
  scan.frames[2].depth = {};
  EXPECT_THAT(error_of([&] { fuse_depth(scan, scan.poses); }).what(),
              HasSubstr("none of 2 frames can be used"));
  for (auto& [node, frame] : scan.frames) frame.depth = DepthImage(128, 96, 0.0F);
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_TRUE(result.cloud.empty());
  EXPECT_EQ(result.pixels.unmeasured, result.pixels.pixels);
  EXPECT_NE(result.cloud.find_field("views"), nullptr);
}

TEST(DepthFusion, OptionsOutOfTheirRangesAreNamed) {
  const MemoryScan scan = ring_scan(plane_z(0), 1, {});
  const auto refused = [&](const std::function<void(DepthFusionOptions&)>& change) {
    DepthFusionOptions options;
    change(options);
    return std::string(error_of([&] { fuse_depth(scan, scan.poses, options); }).what());
  };
  EXPECT_THAT(refused([](auto& o) { o.voxel_size_m = 0; }), HasSubstr("voxel_size_m"));
  EXPECT_THAT(refused([](auto& o) { o.voxel_size_m = NAN; }), HasSubstr("voxel_size_m"));
  EXPECT_THAT(refused([](auto& o) { o.planes.max_depth_m = 0.05; }), HasSubstr("max_depth_m"));
  EXPECT_THAT(refused([](auto& o) { o.planes.radius_px = 8; }), HasSubstr("plane_radius_px"));
  EXPECT_THAT(refused([](auto& o) { o.planes.noise.axial_m = 0; }), HasSubstr("axial_noise_m"));
  EXPECT_THAT(refused([](auto& o) { o.min_views = 0; }), HasSubstr("min_views"));
  EXPECT_THAT(refused([](auto& o) { o.voxel_size_m = 1e-7; }),
              HasSubstr("voxel_size_m is 1e-07: voxels too small"));
  MemoryScan far = ring_scan(plane_z(0), 2, {});
  far.poses[1].world_from_base.translation().x() += 1e6;
  EXPECT_THAT(error_of([&] { fuse_depth(far, far.poses); }).what(),
              HasSubstr("poses lie too far apart"));
}

TEST(DepthFusion, OtherVoxelSizes) {
  const MemoryScan scan = ring_scan(plane_z(0), 4, kinect);
  std::size_t last = 0;
  for (const double size : {0.04, 0.02, 0.005}) {
    DepthFusionOptions options;
    options.voxel_size_m = size;
    const PointCloud cloud = fuse_depth(scan, scan.poses, options).cloud;
    EXPECT_GT(cloud.size(), 2 * last) << size;
    EXPECT_LT(rms(heights_of(cloud)), 0.005) << size;
    last = cloud.size();
  }
}

TEST(DepthFusion, PoseErrorsShowInTheExpectedError) {
  const auto expected = [](const MemoryScan& scan, const Trajectory& poses) {
    DepthFusionOptions options;
    options.registration_rounds = 0;
    const PointCloud cloud = fuse_depth(scan, poses, options).cloud;
    std::vector<double> errors;
    for (std::size_t n = 0; n < cloud.size(); ++n)
      if (cloud.positions[n].head<2>().norm() < 0.3)
        errors.push_back(cloud.find_field("expected_error")->values[n]);
    std::sort(errors.begin(), errors.end());
    return errors[errors.size() / 2];
  };
  const MemoryScan scan = ring_scan(plane_z(0), 16, kinect);
  Trajectory shaken = scan.poses;
  for (TrajectoryPose& pose : shaken)
    pose.world_from_base.translation().z() += uniform(-0.02, 0.02);
  EXPECT_GT(expected(scan, shaken), 2 * expected(scan, scan.poses));
}

TEST(DepthFusion, RealScanLiesOnItsTrueGround) {
  GRASPMAP_REQUIRE_DATA();
  const auto scan = open_scan(graspmap_test::data_folder() / "scans/site_tiny_q.db");
  const DepthFusionResult result =
      fuse_depth(*scan, trajectory_of(scan->graph(), PoseSource::ground_truth));
  EXPECT_EQ(result.frames, 6U);
  EXPECT_GT(result.cloud.size(), 50000U);
  EXPECT_TRUE(result.cloud.has_colors());
  // Outside the site of 3 x 3 m the floor is z = 0.
  std::vector<double> heights;
  for (std::size_t n = 0; n < result.cloud.size(); ++n) {
    const Eigen::Vector3d& point = result.cloud.positions[n];
    if (point.head<2>().cwiseAbs().maxCoeff() < 1.7) continue;
    if (result.cloud.find_field("views")->values[n] >= 2) heights.push_back(point.z());
  }
  ASSERT_GT(heights.size(), 1000U);
  EXPECT_LT(rms(heights), 0.012);
}

}  // namespace
}  // namespace libmap
