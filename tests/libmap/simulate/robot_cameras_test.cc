#include "libmap/simulate/robot_cameras.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace robot_cameras_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::source_folder;
using graspmap_test::square_mesh;
using libmap::CameraRig;
using libmap::Pose;
using libmap::RigCamera;

constexpr double degrees = 180.0 / std::numbers::pi;

CameraRig scar_e() { return libmap::read_rig(source_folder() / "data/rigs/scar-e.yaml"); }

TEST(ScarERig, IsThatOfTheThesis) {
  const CameraRig rig = scar_e();
  ASSERT_EQ(rig.cameras.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    const RigCamera& camera = rig.cameras[i];
    EXPECT_EQ(camera.camera.width, 640);
    EXPECT_EQ(camera.camera.height, 360);
    // Angles between the image's edges, half a pixel outside its outer pixels.
    const auto angle = [&](double u, double v) {
      const Eigen::Vector2d ray = *libmap::pixel_to_ray(camera.camera, {u, v});
      return std::atan(ray.norm()) * degrees;
    };
    EXPECT_NEAR(angle(-0.5, 179.5) + angle(639.5, 179.5), 87.0, 0.01);
    EXPECT_NEAR(angle(319.5, -0.5) + angle(319.5, 359.5), 58.0, 0.01);
    EXPECT_EQ(camera.near_m, 0.28);
    EXPECT_EQ(camera.far_m, 1.5);
    EXPECT_EQ(camera.depth_scale_m, 0.001);
    const Pose& pose = camera.camera.base_from_camera;
    EXPECT_NEAR(pose.translation().norm(), 0.2, 1e-6);
    // It looks outward, level, 60 degrees from the one before.
    const Eigen::Vector3d forward = pose.linear().col(2);
    EXPECT_LT((forward - pose.translation().normalized()).norm(), 1e-6);
    const double yaw = std::atan2(forward.y(), forward.x()) * degrees;
    EXPECT_NEAR(std::remainder(yaw - 60.0 * static_cast<double>(i), 360.0), 0.0, 1e-6);
    EXPECT_NEAR(pose.linear()(2, 1), -1.0, 1e-9);  // the image's down is down
  }
}

TEST(SimulateRobotCameras, ImagesLieOnTheMeshInWholeUnits) {
  CameraRig rig = scar_e();
  rig.cameras[1].depth_scale_m = 1e-4;
  rig.cameras[2].far_m = 0.9;
  const libmap::TriangleMesh mesh =
      graspmap_test::join_meshes(square_mesh(0.1, 5.0), ball_mesh(200, 400, {0.9, 0.1, 0.3}, 0.3));
  const Pose pose = libmap::make_pose_from_rpy({0.05, -0.1, 0.45}, {3, -5, 20});
  const auto images = libmap::simulate_robot_cameras(mesh, rig, pose, {});
  ASSERT_EQ(images.size(), 6U);
  std::size_t on_ball = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    const RigCamera& camera = rig.cameras[i];
    const auto rays = libmap::ray_table(camera.camera);
    std::size_t measured = 0;
    for (std::size_t p = 0; p < rays.size(); ++p) {
      const double depth = images[i].depth.pixels[p] * camera.depth_scale_m;
      if (depth == 0) continue;
      ++measured;
      EXPECT_GE(depth, camera.near_m - camera.depth_scale_m);
      EXPECT_LE(depth, camera.far_m + camera.depth_scale_m);
      const Eigen::Vector3d ray = rays[p].homogeneous();
      const Eigen::Vector3d point = pose * (camera.camera.base_from_camera * (depth * ray));
      // Half a unit along the ray, and the ball's facets.
      const double bound = 0.51 * camera.depth_scale_m * ray.norm() + 1e-5;
      const double ball = std::abs((point - Eigen::Vector3d(0.9, 0.1, 0.3)).norm() - 0.3);
      on_ball += ball < bound + 4e-5;
      ASSERT_LT(std::min(std::abs(point.z() - 0.1), ball - 4e-5), bound) << i << " " << p;
    }
    EXPECT_EQ(measured, images[i].measurement.measured);
    EXPECT_GT(measured, 20000U);
  }
  EXPECT_GT(on_ball, 10000U);
}

TEST(SimulateRobotCameras, SeesAPlaneBetweenNearAndFarAndNothingElse) {
  const CameraRig rig = scar_e();
  const Pose pose = libmap::make_pose_from_rpy({0, 0, 0.3}, {0, 0, 0});
  const auto images = libmap::simulate_robot_cameras(square_mesh(0.0, 5.0), rig, pose, {});
  for (const auto& image : images) {
    // Row v sees the ground at z = 0.3 fy / (v - cy).
    for (int v = 0; v < 360; ++v) {
      const double depth = 0.3 * 324.729 / (v - 179.5);
      const double expected = depth >= 0.28 && depth <= 1.5 ? std::round(depth * 1000) : 0.0;
      EXPECT_NEAR(image.depth.at(123, v), expected, 1.0) << v;
    }
  }
}

TEST(SimulateRobotCameras, StampsLieWithinTheSpread) {
  libmap::RobotCamerasOptions options;
  options.stamp_s = 12.0;
  options.stamp_spread_s = 0.01;
  std::set<double> stamps;
  for (const auto& image :
       libmap::simulate_robot_cameras(square_mesh(0.0), scar_e(), Pose::Identity(), options)) {
    EXPECT_GE(image.stamp_s, 12.0);
    EXPECT_LT(image.stamp_s, 12.01);
    stamps.insert(image.stamp_s);
  }
  EXPECT_EQ(stamps.size(), 6U);
}

TEST(SimulateRobotCameras, NoiseIsSeededAndUnitsThatDoNotFitAreNone) {
  CameraRig rig = scar_e();
  rig.cameras.resize(1);
  const Pose pose = libmap::make_pose_from_rpy({0, 0, 0.3}, {0, 0, 0});
  libmap::RobotCamerasOptions options;
  options.depth.noise_m = 0.002;
  const auto image = [&] {
    return libmap::simulate_robot_cameras(square_mesh(0.0, 5.0), rig, pose, options)[0].depth;
  };
  const auto first = image();
  {
    const libmap::ThreadLimit limit(1);
    EXPECT_EQ(image(), first);
  }
  options.seed = 2;
  EXPECT_NE(image(), first);
  // 65535 units of 0.01 mm are 0.655 m.
  rig.cameras[0].depth_scale_m = 1e-5;
  options.depth.noise_m = 0;
  const auto fine = image();
  EXPECT_EQ(fine.at(300, 179 + 100), 0);  // 0.98 m
  EXPECT_NEAR(fine.at(300, 179 + 170), 0.3 * 324.729 / 169.5 * 1e5, 1.0);
}

TEST(GroundHeight, IsThatOfTheHighestSurface) {
  const libmap::TriangleMesh mesh =
      graspmap_test::join_meshes(square_mesh(-0.5, 2.0), ball_mesh(200, 400, {0, 0, 0}, 0.3));
  EXPECT_NEAR(libmap::ground_height(mesh, 1.0, 1.0), -0.5, 1e-12);
  EXPECT_NEAR(libmap::ground_height(mesh, 0.1, 0.2), std::sqrt(0.09 - 0.05), 1e-4);
  EXPECT_EQ(error_of([&] { libmap::ground_height(mesh, 3.0, 0.0); }).context().value, "3, 0");
}

}  // namespace robot_cameras_test
