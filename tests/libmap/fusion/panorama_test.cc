#include "libmap/fusion/panorama.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace panorama_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::Camera;
using libmap::DistortionModel;
using libmap::make_panorama;
using libmap::PanoramaOptions;
using libmap::PanoramaResult;
using libmap::PanoramaView;

Camera camera_of(DistortionModel model, std::vector<double> terms) {
  Camera camera;
  camera.width = 64;
  camera.height = 36;
  camera.fx = 33.7;
  camera.fy = 34.1;
  camera.cx = 31.2;
  camera.cy = 17.9;
  camera.distortion_model = model;
  camera.distortion = std::move(terms);
  return camera;
}

// A sphere of radius 2 m around the robot's origin, seen from within by six cameras 60 degrees
// apart and 20 cm from the center: the depth of each pixel is that of the ray which the lens bends
// there.
std::vector<PanoramaView> sphere_views(DistortionModel model, const std::vector<double>& terms) {
  std::vector<PanoramaView> views;
  for (int n = 0; n < 6; ++n) {
    PanoramaView view;
    view.name = "camera_" + std::to_string(n);
    view.index = n;
    view.camera = camera_of(model, terms);
    view.camera.base_from_camera = libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, 60.0 * n}) *
                                   libmap::make_pose_from_rpy({0.2, 0, 0}, {0, 20, 0}) *
                                   libmap::optical_to_body_rotation();
    view.depth = libmap::DepthImage(64, 36);
    const Eigen::Vector3d eye = view.camera.base_from_camera.translation();
    for (int y = 0; y < 36; ++y)
      for (int x = 0; x < 64; ++x) {
        const auto ray = libmap::pixel_to_ray(view.camera, Eigen::Vector2d(x, y));
        if (!ray) continue;
        // |eye + z d| = 2 with d = (x/z, y/z, 1) in the robot's frame.
        const Eigen::Vector3d d =
            view.camera.base_from_camera.linear() * Eigen::Vector3d(ray->x(), ray->y(), 1);
        const double b = eye.dot(d);
        const double z =
            (-b + std::sqrt(b * b - d.squaredNorm() * (eye.squaredNorm() - 4))) / d.squaredNorm();
        view.depth.at(x, y) = static_cast<float>(z);
      }
    views.push_back(view);
  }
  return views;
}

TEST(Panorama, PointsLieWhereTheyWereSeen) {
  const std::pair<DistortionModel, std::vector<double>> lenses[] = {
      {DistortionModel::none, {}},
      {DistortionModel::radial_tangential, {0.08, -0.03, 0.001, -0.002, 0.004}},
      {DistortionModel::equidistant, {0.03, -0.01, 0.002, 0.0}}};
  for (const auto& [model, terms] : lenses) {
    const auto views = sphere_views(model, terms);
    const PanoramaResult result = make_panorama(views);
    ASSERT_EQ(result.cloud.size(), 6U * 64 * 36);
    const std::vector<double>& camera = result.cloud.find_field("camera")->values;
    for (std::size_t n = 0; n < result.cloud.size(); ++n) {
      ASSERT_NEAR(result.cloud.positions[n].norm(), 2.0, 1e-6);
      const std::size_t view = n / (64 * 36);
      ASSERT_EQ(camera[n], static_cast<double>(view));
    }
    // The pixel goes back to itself.
    const Eigen::Vector3d point = views[2].camera.base_from_camera.inverse() *
                                  result.cloud.positions[2 * 64 * 36 + 5 * 64 + 9];
    const auto pixel = libmap::project_point(views[2].camera, point);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - Eigen::Vector2d(9, 5)).norm(), 1e-5);
  }
}

TEST(Panorama, BackProjectionInClosedForm) {
  PanoramaView view;
  view.camera = camera_of(DistortionModel::none, {});
  view.camera.fx = 20;
  view.camera.fy = 10;
  view.camera.cx = 30;
  view.camera.cy = 16;
  view.camera.base_from_camera.translation() = Eigen::Vector3d(0.2, 0, 0.1);
  view.depth = libmap::DepthImage(64, 36);
  view.depth.at(40, 11) = 1.5F;
  const PanoramaResult result = make_panorama({view});
  ASSERT_EQ(result.cloud.size(), 1U);
  // x_c = (40 - 30) 1.5 / 20 = 0.75, y_c = (11 - 16) 1.5 / 10 = -0.75; body: z, -x, -y.
  EXPECT_LT((result.cloud.positions[0] - Eigen::Vector3d(1.5 + 0.2, -0.75, 0.75 + 0.1)).norm(),
            1e-12);
}

TEST(Panorama, LimitsAreInclusiveAndCounted) {
  PanoramaView view;
  view.camera = camera_of(DistortionModel::none, {});
  view.depth = libmap::DepthImage(64, 36);
  view.near_m = 0.25;
  view.far_m = 1.5;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float depths[] = {0.25F, 0.2499F, 1.5F, 1.5001F, nan, -1.0F, HUGE_VALF, 0.0F};
  for (int n = 0; n < 8; ++n) view.depth.at(n, 0) = depths[n];
  const PanoramaResult result = make_panorama({view});
  const libmap::PanoramaCounts& counts = result.views.at(0);
  EXPECT_EQ(counts.points, 2U);
  EXPECT_EQ(counts.too_near, 1U);
  EXPECT_EQ(counts.too_far, 1U);
  EXPECT_EQ(counts.unmeasured, 64U * 36 - 4);
  EXPECT_EQ(counts.pixels, 64U * 36);
  EXPECT_EQ(result.cloud.size(), 2U);
}

TEST(Panorama, StrideTakesEveryNthPixel) {
  const auto views = sphere_views(DistortionModel::none, {});
  const PanoramaResult all = make_panorama({views[1]});
  PanoramaOptions options;
  options.stride_px = 5;
  const PanoramaResult some = make_panorama({views[1]}, options);
  ASSERT_EQ(some.cloud.size(), 13U * 8);
  for (std::size_t n = 0; n < some.cloud.size(); ++n)
    EXPECT_EQ(some.cloud.positions[n], all.cloud.positions[n / 13 * 5 * 64 + n % 13 * 5]);
}

TEST(Panorama, FlyingPixelsBetweenTwoSurfaces) {
  PanoramaView view;
  view.camera = camera_of(DistortionModel::none, {});
  view.depth = libmap::DepthImage(64, 36, 2.0F);
  for (int y = 0; y < 36; ++y) {
    for (int x = 30; x < 64; ++x) view.depth.at(x, y) = 1.0F;
    view.depth.at(30, y) = 1.5F;
  }
  PanoramaOptions options;
  options.flying_pixel_jump_m = 0.1;
  const PanoramaResult result = make_panorama({view}, options);
  EXPECT_EQ(result.views[0].flying, 36U);
  for (const Eigen::Vector3d& point : result.cloud.positions) EXPECT_NE(point.x(), 1.5);
  EXPECT_EQ(make_panorama({view}).views[0].flying, 0U);
}

TEST(Panorama, NormalsOfASphereLookInward) {
  const auto views = sphere_views(DistortionModel::radial_tangential, {0.05, -0.01, 0, 0});
  PanoramaOptions options;
  options.normals = true;
  options.normal_jump_m = 0.5;
  const PanoramaResult result = make_panorama(views, options);
  ASSERT_EQ(result.cloud.normals.size(), result.cloud.size());
  for (std::size_t n = 0; n < result.cloud.size(); ++n) {
    const Eigen::Vector3d normal = result.cloud.normals[n].cast<double>();
    ASSERT_NEAR(normal.norm(), 1.0, 1e-5);
    // 0.04 rad: the sphere bends within the two pixels that a border's difference spans.
    ASSERT_LT((normal + result.cloud.positions[n] / 2).norm(), 0.04) << n;
  }
}

TEST(Panorama, NormalsWhereNeighborsAreMissing) {
  PanoramaView view;
  view.camera = camera_of(DistortionModel::none, {});
  view.depth = libmap::DepthImage(64, 36);
  view.depth.at(10, 10) = 1.0F;  // alone
  view.depth.at(20, 20) = view.depth.at(21, 20) = view.depth.at(20, 21) = 1.0F;
  PanoramaOptions options;
  options.normals = true;
  const PanoramaResult result = make_panorama({view}, options);
  ASSERT_EQ(result.cloud.size(), 4U);
  EXPECT_EQ(result.cloud.normals[0], Eigen::Vector3f(0, 0, 0));
  EXPECT_LT((result.cloud.normals[1] - Eigen::Vector3f(-1, 0, 0)).norm(), 1e-6F);
  EXPECT_EQ(result.cloud.normals[2], Eigen::Vector3f(0, 0, 0));
}

TEST(Panorama, SameForAnyNumberOfThreads) {
  const auto views = sphere_views(DistortionModel::radial_tangential, {0.08, -0.03, 0.001, 0});
  PanoramaOptions options;
  options.normals = true;
  const PanoramaResult many = make_panorama(views, options);
  const libmap::ThreadLimit limit(1);
  const PanoramaResult one = make_panorama(views, options);
  EXPECT_EQ(many.cloud.positions, one.cloud.positions);
  EXPECT_EQ(many.cloud.normals, one.cloud.normals);
}

TEST(Panorama, NoViewsAndWrongArguments) {
  EXPECT_TRUE(make_panorama({}).cloud.empty());
  PanoramaOptions options;
  options.stride_px = 0;
  EXPECT_TRUE(is_error(error_of([&] { make_panorama({}, options); }),
                       {.field = "stride_px", .value = "0", .bound = ">= 1 and <= 1e+06"}));
}

}  // namespace panorama_test
