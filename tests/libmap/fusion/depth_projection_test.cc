#include "libmap/fusion/depth_projection.h"

#include <gtest/gtest.h>

#include <thread>

#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_projection_test {

using graspmap_test::small_camera;

Camera bent_camera() {
  Camera camera = small_camera();
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {-0.25, 0.08, 0.003, -0.002, 0.0};
  return camera;
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
  const auto pixels = static_cast<std::size_t>(camera.width * camera.height) + PixelRays::padding;
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
