// Accuracy and invariants of fusion.
#include "libmap/fusion/depth_fusion.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/libmap/fusion/fusion_checks.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_fusion_test {

using graspmap_test::box;
using graspmap_test::distance_from_step;
using graspmap_test::heights_of;
using graspmap_test::kinect;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::ring_scan;
using graspmap_test::rms;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using graspmap_test::step_scene;
using graspmap_test::Surface;
using graspmap_test::uniform;

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
  // One point per voxel column, and none is missing around the middle.
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
  // Averages of noisy positions would be biased at the far end.
  const MemoryScan scan = ring_scan(plane_z(0), 24, kinect, Eigen::Vector3d::Zero(), 1.6, 0.6);
  const std::vector<double> heights = heights_of(fuse_depth(scan, scan.poses).cloud);
  double mean = 0;
  for (const double height : heights) mean += height / static_cast<double>(heights.size());
  EXPECT_LT(std::abs(mean), 0.0002);
}

TEST(DepthFusion, SphereFromAllAround) {
  const Eigen::Vector3d center(0.02, -0.03, 0.4);
  MemoryScan scan;
  for (int n = 0; n < 24; ++n) {
    // Fibonacci's spiral.
    const double z = 1 - 2 * (n + 0.5) / 24;
    const double angle = 2.399963 * n;
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d eye(r * std::cos(angle), r * std::sin(angle), z);
    scan.see(sphere(center, 0.25), looking(center + 1.1 * eye, center), small_camera(), kinect,
             random_engine());
  }
  const PointCloud cloud = fuse_depth(scan, scan.poses).cloud;
  EXPECT_GT(cloud.size(), 6000U);
  std::vector<double> errors;
  double mean = 0;
  std::size_t well_turned = 0;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d arm = cloud.positions[n] - center;
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

// One frame of twelve shows a plate that the others see through.
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
  options.points.max_seen_through = 1000;
  EXPECT_GT(points_above(fuse_depth(scan, scan.poses, options).cloud, 0.1), 200U);
  options.points.min_views = 2;
  const DepthFusionResult confirmed = fuse_depth(scan, scan.poses, options);
  EXPECT_EQ(points_above(confirmed.cloud, 0.1), 0U);
  EXPECT_GT(confirmed.points.unconfirmed, 200U);
}

// One frame of thirteen shows a ball above a table; other frames measure nothing behind it.
TEST(DepthFusion, WhatOthersMissIsDropped) {
  const Surface table = box({-0.6, -0.6, -0.05}, {0.6, 0.6, 0.0});
  MemoryScan scan = ring_scan(table, 12, {}, Eigen::Vector3d::Zero(), 1.5, 0.5);
  scan.see(nearest_of({table, sphere({0, 0, 0.35}, 0.1)}), looking({1.5, 0, 0.5}, {0, 0, 0}),
           small_camera(), {}, random_engine());
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(points_above(result.cloud, 0.1), 0U);
  EXPECT_GT(result.points.missed, 20U);
  DepthFusionOptions options;
  options.points.max_missed = 1000;
  const DepthFusionResult all = fuse_depth(scan, scan.poses, options);
  EXPECT_GT(points_above(all.cloud, 0.1), 20U);
  EXPECT_EQ(points_above(all.cloud, -0.01) - points_above(all.cloud, 0.1),
            points_above(result.cloud, -0.01))
      << "the table stays, its edge too";
}

// A post whose upper part is outside the other frames' images is dropped with its lower part.
TEST(DepthFusion, WhatHangsTogetherWithWhatIsDroppedIsDropped) {
  MemoryScan scan = ring_scan(plane_z(0), 11, {});
  const Surface post = box({-0.05, -0.05, 0.1}, {0.05, 0.05, 0.9});
  scan.see(nearest_of({plane_z(0), post}), looking({1.2, 0, 0.7}, {0, 0, 0.5}), small_camera(), {},
           random_engine());
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(points_above(result.cloud, 0.15), 0U);
  EXPECT_GT(result.points.contradicted, 50U);
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

TEST(DepthFusion, OneKilometerAway) {
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

}  // namespace depth_fusion_test
}  // namespace libmap
