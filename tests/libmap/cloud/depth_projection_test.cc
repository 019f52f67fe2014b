#include "libmap/cloud/depth_projection.h"

#include <gmock/gmock.h>

#include <thread>

#include "tests/libmap/cloud/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_projection_test {

using graspmap_test::error_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::render_depth;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using ::testing::HasSubstr;

Camera bent_camera() {
  Camera camera = small_camera();
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {-0.25, 0.08, 0.003, -0.002, 0.0};
  return camera;
}

TEST(DepthProjection, PixelsOfAPinholeCamera) {
  const Camera camera = small_camera();
  DepthImage depth(camera.width, camera.height);
  depth.at(0, 0) = 2.0F;
  depth.at(100, 30) = 1.5F;
  const std::vector<Eigen::Vector3d> points = back_project(depth, camera, 0.1, 4.0);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_LT((points[0] - Eigen::Vector3d(2 * -63.5 / 110, 2 * -47.5 / 110, 2)).norm(), 1e-12);
  EXPECT_LT((points[1] - Eigen::Vector3d(1.5 * 36.5 / 110, 1.5 * -17.5 / 110, 1.5)).norm(), 1e-12);
}

TEST(DepthProjection, PlaneAndSphereComeBackThroughAnyLens) {
  for (const Camera& camera : {small_camera(), bent_camera()}) {
    const auto wall = back_project(
        render_depth(plane_z(1.7), camera, Pose::Identity(), {}, random_engine()), camera, 0.1, 4);
    EXPECT_GT(wall.size(), 12000U);
    for (const Eigen::Vector3d& point : wall) ASSERT_NEAR(point.z(), 1.7, 1e-6);
    const Eigen::Vector3d center(0.1, -0.05, 1.2);
    const auto ball = back_project(
        render_depth(sphere(center, 0.4), camera, Pose::Identity(), {}, random_engine()), camera,
        0.1, 4);
    EXPECT_GT(ball.size(), 2000U);
    for (const Eigen::Vector3d& point : ball) ASSERT_NEAR((point - center).norm(), 0.4, 1e-6);
  }
}

TEST(DepthProjection, LimitsAndWhatIsNoMeasurement) {
  const Camera camera = small_camera();
  DepthImage depth(camera.width, camera.height);
  depth.pixels[0] = 0.5F;
  depth.pixels[1] = 3.0F;
  depth.pixels[2] = std::numeric_limits<float>::quiet_NaN();
  depth.pixels[3] = std::numeric_limits<float>::infinity();
  depth.pixels[4] = -1.0F;
  depth.pixels[5] = 0.49F;
  depth.pixels[6] = 3.01F;
  EXPECT_EQ(back_project(depth, camera, 0.5, 3.0).size(), 2U);
}

TEST(DepthProjection, ImageOfAnotherSizeIsRefused) {
  const Error error = error_of([] { back_project(DepthImage(10, 7), small_camera(), 0.1, 4); });
  EXPECT_THAT(error.what(), HasSubstr("10 x 7"));
  EXPECT_THAT(error.what(), HasSubstr("128 x 96"));
}

TEST(DepthProjection, RaysAreThoseOfTheCamera) {
  Camera camera = bent_camera();
  camera.distortion = {-0.9, 0.0, 0.0, 0.0};  // folds: the corners have no ray
  const auto table = ray_table(camera);
  const PixelRays rays = pixel_rays(camera);
  std::size_t blind = 0;
  for (std::size_t n = 0; n < table.size(); ++n) {
    if (!table[n].allFinite()) {
      ASSERT_LT(blind, rays.blind.size());
      EXPECT_EQ(rays.blind[blind++], n);
      EXPECT_EQ(rays.x[n], 0.0F);
      continue;
    }
    EXPECT_EQ(rays.x[n], static_cast<float>(table[n].x()));
    EXPECT_LE(rays.min.x(), table[n].x());
    EXPECT_GE(rays.max.y(), table[n].y());
  }
  EXPECT_GT(blind, 0U);
  EXPECT_EQ(blind, rays.blind.size());
  EXPECT_GE(rays.x.size(), table.size() + 4) << "four may be read at once";
}

TEST(DepthProjection, EachLensIsWorkedOutOnce) {
  PixelRayCache cache;
  std::shared_ptr<const PixelRays> first = cache.rays_of(small_camera());
  std::shared_ptr<const PixelRays> other;
  std::thread thread([&] {
    Camera moved = small_camera();
    moved.base_from_camera.translation().x() = 5;
    other = cache.rays_of(moved);
  });
  thread.join();
  EXPECT_EQ(first, other) << "where a camera sits does not bend its rays";
  EXPECT_NE(first, cache.rays_of(bent_camera()));
}

TEST(DepthProjection, ManyLensesAreNotAllKept) {
  const Camera camera = small_camera();
  const auto pixels = static_cast<std::size_t>(camera.width * camera.height) + 4;
  PixelRayCache cache(3 * pixels);
  std::vector<std::weak_ptr<const PixelRays>> rays;
  for (int n = 0; n < 5; ++n) {
    Camera focused = camera;
    focused.fx += n;
    rays.push_back(cache.rays_of(focused));
  }
  for (std::size_t n = 0; n < rays.size(); ++n) EXPECT_EQ(rays[n].expired(), n < 2) << n;
  PixelRayCache least(1);
  EXPECT_EQ(least.rays_of(camera), least.rays_of(camera)) << "one is kept whatever its size";
}

}  // namespace depth_projection_test
}  // namespace libmap
