// Depth that a calibration registers to color, compared with the measured plane.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/camera/camera_io.h"
#include "libmap/scan/scan_source.h"

namespace libmap {
namespace registered_depth_test {

constexpr int width = 160;
constexpr int height = 120;
const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, -1.0).normalized();
constexpr double distance = -1.2;  // normal . point

Camera lens(DistortionModel model) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 120;
  camera.cx = 80.2;
  camera.cy = 59.1;
  camera.distortion_model = model;
  if (model == DistortionModel::radial_tangential)
    camera.distortion = {0.26, -0.5, -0.005, 0.003, 0.4};
  if (model == DistortionModel::equidistant) camera.distortion = {0.02, -0.01, 0.001, 0.0};
  return camera;
}

double plane_depth(const Eigen::Vector2d& ray, const Pose& camera_from_plane) {
  const Eigen::Vector3d n = camera_from_plane.linear() * normal;
  return (distance + n.dot(camera_from_plane.translation())) / n.dot(ray.homogeneous());
}

void expect_registered(DistortionModel model, const Pose& color_from_depth) {
  RgbdFrame frame;
  frame.cameras = {lens(model)};
  frame.depth = DepthImage(width, height);
  const auto rays = ray_table(frame.cameras.front());
  for (std::size_t n = 0; n < rays.size(); ++n)
    frame.depth.pixels[n] = static_cast<float>(plane_depth(rays[n], Pose::Identity()));
  CameraFile calibration;
  calibration.camera = lens(model);
  calibration.color_from_depth = color_from_depth;
  apply_calibration(frame, calibration);
  int found = 0;
  for (std::size_t n = 0; n < rays.size(); ++n) {
    if (frame.depth.pixels[n] == 0.0F) continue;
    ++found;
    const int x = static_cast<int>(n) % width;
    const int y = static_cast<int>(n) / width;
    if (std::min({x, y, width - 1 - x, height - 1 - y}) < 8) continue;
    ASSERT_NEAR(static_cast<double>(frame.depth.pixels[n]), plane_depth(rays[n], color_from_depth),
                1e-3)
        << x << ' ' << y;
  }
  EXPECT_GT(found, width * height * 85 / 100);
}

TEST(RegisteredDepth, OfAMovedCamera) {
  const Pose motion = make_pose_from_rpy({0.01, -0.005, 0.02}, {0.5, -2.0, 1.0});
  for (const DistortionModel model :
       {DistortionModel::none, DistortionModel::radial_tangential, DistortionModel::equidistant})
    expect_registered(model, motion);
}

TEST(RegisteredDepth, HolesAndEdgesGiveNoDepthBetweenSurfaces) {
  RgbdFrame frame;
  frame.cameras = {lens(DistortionModel::none)};
  frame.depth = DepthImage(width, height, 1.0F);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) frame.depth.at(x, y) = x < 60 ? 1.0F : x < 70 ? 0.0F : 2.0F;
  CameraFile calibration;
  calibration.camera = lens(DistortionModel::none);
  calibration.color_from_depth = make_pose_from_rpy({0, 0, 0}, {0, 0.5, 0});
  apply_calibration(frame, calibration);
  int near = 0;
  int far = 0;
  for (const float z : frame.depth.pixels) {
    near += std::abs(z - 1.0F) < 0.01F ? 1 : 0;
    far += std::abs(z - 2.0F) < 0.02F ? 1 : 0;
    EXPECT_TRUE(z == 0.0F || std::abs(z - 1.0F) < 0.01F || std::abs(z - 2.0F) < 0.02F) << z;
  }
  EXPECT_NEAR(near, 60 * height, 3 * height);
  EXPECT_NEAR(far, 90 * height, 3 * height);
}

}  // namespace registered_depth_test
}  // namespace libmap
