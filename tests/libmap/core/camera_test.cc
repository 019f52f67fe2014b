#include "libmap/core/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "libmap/core/image.h"
#include "tests/support/test_support.h"

namespace camera_test {

using Eigen::Vector2d;
using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::uniform;
using libmap::Camera;
using libmap::DistortionModel;

Camera kinect() {
  return {.width = 512, .height = 424, .fx = 365.0, .fy = 364.0, .cx = 255.5, .cy = 211.25};
}

Camera distorted(DistortionModel model, std::vector<double> terms) {
  Camera camera = kinect();
  camera.distortion_model = model;
  camera.distortion = std::move(terms);
  return camera;
}

// Typical lenses: a Kinect v2 infrared camera, a rational model, thin prisms, a fisheye.
std::vector<Camera> lenses() {
  return {kinect(),
          distorted(DistortionModel::radial_tangential, {0.09, -0.27, 0.0008, -0.0004, 0.09}),
          distorted(DistortionModel::radial_tangential, {-0.2, 0.05, 0.001, -0.002}),
          distorted(DistortionModel::radial_tangential,
                    {0.4, -0.1, 0.0008, -0.0004, 0.02, 0.5, -0.05, 0.03}),
          distorted(DistortionModel::radial_tangential,
                    {0.1, -0.1, 0.001, 0.002, 0.01, 0, 0, 0, 0.002, -0.001, 0.003, 0.001}),
          distorted(DistortionModel::equidistant, {0.02, -0.01, 0.004, -0.001})};
}

TEST(CameraTest, PinholeInClosedForm) {
  const Camera camera = kinect();
  const auto pixel = libmap::project_point(camera, Vector3d(0.5, -0.25, 2.0));
  ASSERT_TRUE(pixel);
  EXPECT_DOUBLE_EQ(pixel->x(), 365.0 * 0.25 + 255.5);
  EXPECT_DOUBLE_EQ(pixel->y(), -364.0 * 0.125 + 211.25);
  EXPECT_FALSE(libmap::project_point(camera, Vector3d(0.5, 0.5, 0.0)));
  EXPECT_FALSE(libmap::project_point(camera, Vector3d(0.5, 0.5, -1.0)));
  EXPECT_FALSE(
      libmap::project_point(camera, Vector3d(0.5, 0.5, std::numeric_limits<double>::quiet_NaN())));
}

// The formulas as OpenCV's documentation prints them, term by term.
TEST(CameraTest, DistortionFollowsTheFormulas) {
  const std::vector<double> k{0.4,  -0.3, 0.0008, -0.0004, 0.02,  0.5,
                              -0.2, 0.03, 0.002,  -0.001,  0.003, 0.001};
  const Camera camera = distorted(DistortionModel::radial_tangential, k);
  const double x = 0.31;
  const double y = -0.22;
  const double r2 = x * x + y * y;
  const double r4 = r2 * r2;
  const double r6 = r4 * r2;
  const double radial =
      (1 + k[0] * r2 + k[1] * r4 + k[4] * r6) / (1 + k[5] * r2 + k[6] * r4 + k[7] * r6);
  const double xd = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + k[8] * r2 + k[9] * r4;
  const double yd =
      y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + k[10] * r2 + k[11] * r4;
  const Vector2d pixel = libmap::distort_to_pixel(camera, Vector2d(x, y));
  EXPECT_NEAR(pixel.x(), camera.fx * xd + camera.cx, 1e-10);
  EXPECT_NEAR(pixel.y(), camera.fy * yd + camera.cy, 1e-10);

  const Camera fisheye = distorted(DistortionModel::equidistant, {0.02, -0.01, 0.004, -0.001});
  const double r = std::sqrt(r2);
  const double t = std::atan(r);
  const double td = t * (1 + 0.02 * std::pow(t, 2) - 0.01 * std::pow(t, 4) +
                         0.004 * std::pow(t, 6) - 0.001 * std::pow(t, 8));
  const Vector2d bent = libmap::distort_to_pixel(fisheye, Vector2d(x, y));
  EXPECT_NEAR(bent.x(), fisheye.fx * x * td / r + fisheye.cx, 1e-10);
  EXPECT_NEAR(bent.y(), fisheye.fy * y * td / r + fisheye.cy, 1e-10);
}

// Without coefficients, the radius in the image is the angle, not its tangent.
TEST(CameraTest, AnIdealFisheyeIsNoPinhole) {
  const Camera fisheye = distorted(DistortionModel::equidistant, {0, 0, 0, 0});
  const Vector2d pixel = libmap::distort_to_pixel(fisheye, Vector2d(std::tan(0.8), 0.0));
  EXPECT_NEAR(pixel.x(), fisheye.cx + fisheye.fx * 0.8, 1e-9);
}

TEST(CameraTest, EveryPixelsRayComesBackToItsPixel) {
  for (const Camera& camera : lenses()) {
    for (int trial = 0; trial < 2000; ++trial) {
      const Vector2d pixel(uniform(-0.5, 511.5), uniform(-0.5, 423.5));
      const auto ray = libmap::pixel_to_ray(camera, pixel);
      ASSERT_TRUE(ray) << pixel.transpose();
      const auto back = libmap::project_point(camera, Vector3d(ray->x() * 3, ray->y() * 3, 3.0));
      ASSERT_TRUE(back);
      EXPECT_LT((*back - pixel).norm(), 1e-8) << pixel.transpose();
    }
  }
}

// A barrel distortion whose polynomial has a maximum: pixels beyond it have no ray.
TEST(CameraTest, PixelsThatNoRayReachesAreNotInvented) {
  const Camera camera = distorted(DistortionModel::radial_tangential, {-1.2, 0.0, 0.0, 0.0});
  // x (1 - 1.2 x^2) is largest at x = 1 / sqrt(3.6): 0.351.
  const double largest = 2.0 / 3.0 / std::sqrt(3.6);
  EXPECT_TRUE(
      libmap::pixel_to_ray(camera, Vector2d(camera.cx + 365 * (largest - 1e-3), camera.cy)));
  EXPECT_FALSE(
      libmap::pixel_to_ray(camera, Vector2d(camera.cx + 365 * (largest + 1e-3), camera.cy)));
  const std::vector<Vector2d> table = libmap::ray_table(camera);
  EXPECT_TRUE(std::isnan(table.front().x()));
  EXPECT_TRUE(table[static_cast<std::size_t>(212 * 512 + 256)].allFinite());

  const Camera fisheye = distorted(DistortionModel::equidistant, {0.0, 0.0, 0.0, 1e-9});
  EXPECT_FALSE(libmap::pixel_to_ray(fisheye, Vector2d(fisheye.cx + 365 * 1.6, fisheye.cy)));
}

TEST(CameraTest, RayTableIsPixelByPixel) {
  const Camera camera = lenses()[1];
  const std::vector<Vector2d> table = libmap::ray_table(camera);
  ASSERT_EQ(table.size(), 512u * 424u);
  for (const auto& [x, y] : {std::pair{0, 0}, {511, 0}, {0, 423}, {300, 17}}) {
    const auto ray = libmap::pixel_to_ray(camera, Vector2d(x, y));
    ASSERT_TRUE(ray);
    EXPECT_EQ(table[static_cast<std::size_t>(y * 512 + x)], *ray);
  }
}

TEST(CameraTest, OpticalAxesInTheBody) {
  const libmap::Pose pose = libmap::optical_to_body_rotation();
  EXPECT_EQ(pose * Vector3d::UnitZ(), Vector3d::UnitX());
  EXPECT_EQ(pose * Vector3d::UnitX(), -Vector3d::UnitY());
  EXPECT_EQ(pose * Vector3d::UnitY(), -Vector3d::UnitZ());
  EXPECT_EQ(pose.linear().determinant(), 1.0);
}

TEST(CameraTest, WhatCannotBeACameraIsNamed) {
  const auto field_of = [](auto change) {
    Camera camera = kinect();
    change(camera);
    return error_of([&] { camera.check(); }).context().field;
  };
  EXPECT_NO_THROW(kinect().check());
  EXPECT_EQ(field_of([](Camera& c) { c.width = 0; }), "width");
  EXPECT_EQ(field_of([](Camera& c) { c.height = -3; }), "height");
  EXPECT_EQ(field_of([](Camera& c) { c.fx = 0; }), "fx");
  EXPECT_EQ(field_of([](Camera& c) { c.fy = std::nan(""); }), "fy");
  EXPECT_EQ(field_of([](Camera& c) { c.cx = INFINITY; }), "cx");
  EXPECT_EQ(field_of([](Camera& c) { c.cy = std::nan(""); }), "cy");
  EXPECT_EQ(field_of([](Camera& c) { c.base_from_camera.translation().x() = std::nan(""); }),
            "base_from_camera");
  EXPECT_EQ(field_of([](Camera& c) { c.distortion = {std::nan("")}; }), "distortion");
  // Rays and their products would exceed the range of doubles.
  EXPECT_EQ(field_of([](Camera& c) { c.fx = 1e-300; }), "fx");
  EXPECT_EQ(field_of([](Camera& c) { c.fy = 1e300; }), "fy");
  EXPECT_EQ(field_of([](Camera& c) { c.cx = -1e300; }), "cx");
  EXPECT_EQ(field_of([](Camera& c) { c.cy = 1e10; }), "cy");
  EXPECT_EQ(field_of([](Camera& c) { c.distortion = {0, 0, 0, 1e100}; }), "distortion");
  EXPECT_EQ(field_of([](Camera& c) { c.base_from_camera.translation().z() = 1e308; }),
            "base_from_camera");
  EXPECT_EQ(field_of([](Camera& c) {
              c.distortion_model = DistortionModel::radial_tangential;
              c.distortion = {0.1, 0.2, 0.3};
            }),
            "number of distortion terms");
  EXPECT_EQ(field_of([](Camera& c) {
              c.distortion_model = DistortionModel::equidistant;
              c.distortion = {0, 0, 0, 0, 0};
            }),
            "number of distortion terms");
}

TEST(ImageTest, ColumnsOfImagesSideBySide) {
  libmap::DepthImage pair(6, 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 6; ++x) pair.at(x, y) = static_cast<float>(10 * y + x);
  const libmap::DepthImage right = libmap::crop_columns(pair, 3, 3);
  EXPECT_EQ(right.width, 3);
  EXPECT_EQ(right.pixels, (std::vector<float>{3, 4, 5, 13, 14, 15}));
}

}  // namespace camera_test
