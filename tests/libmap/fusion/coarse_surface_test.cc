#include "libmap/fusion/depth_planes.h"

#include <gtest/gtest.h>

#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace coarse_surface_test {

using graspmap_test::box;
using graspmap_test::looking;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;

constexpr double voxel_m = 0.02;

// A box on the ground: flat and slanted surfaces, edges, and noise that moves planes off their
// pixels.
class CoarseSurface : public ::testing::Test {
 protected:
  SurfaceVoxels voxels_in(const TileMask& cells, FittedPixels fitted) {
    SurfaceVoxels voxels;
    counts_ = add_depth_planes(depth_, rays_, eye_, {}, voxel_m, cells, fitted, voxels);
    return voxels;
  }

  const Camera camera_ = graspmap_test::small_camera();
  const PixelRays rays_ = pixel_rays(camera_);
  const Pose eye_ = looking({-1.2, 0.3, 1.1}, {0, 0, 0.1}) * optical_to_body_rotation();
  const DepthImage depth_ = graspmap_test::render_depth(
      nearest_of({plane_z(0), box({-0.2, -0.2, 0}, {0.25, 0.2, 0.3})}), camera_, eye_,
      {.axial_m = 0.002, .of_range = 0.005}, graspmap_test::random_engine());
  DepthPixelCounts counts_;
};

TEST_F(CoarseSurface, PixelsInTheCellsGiveTheVoxelsOfAllPixels) {
  std::size_t compared = 0;
  for (const int x : {-30, -8, 0, 14})
    for (const int y : {-12, 0, 6}) {
      const TileMask cells{{x, y}, {x + 17, y + 9}, 0};
      const SurfaceVoxels all = voxels_in(cells, FittedPixels::all);
      EXPECT_EQ(counts_.pixels, depth_.pixels.size());
      const SurfaceVoxels some = voxels_in(cells, FittedPixels::in_cells);
      ASSERT_EQ(some.index().keys(), all.index().keys());
      for (std::size_t n = 0; n < all.size(); ++n) {
        ASSERT_EQ(some.sums()[n].weight, all.sums()[n].weight);
        ASSERT_EQ(some.sums()[n].offset, all.sums()[n].offset);
        ASSERT_EQ(some.sums()[n].normal, all.sums()[n].normal);
      }
      compared += all.size();
    }
  EXPECT_GT(compared, 500U);
}

TEST_F(CoarseSurface, CellsThatTheImageDoesNotReachHaveNoVoxels) {
  EXPECT_EQ(voxels_in({{500, 500}, {520, 520}, 0}, FittedPixels::in_cells).size(), 0U);
  EXPECT_EQ(counts_.used, 0U);
}

}  // namespace coarse_surface_test
}  // namespace libmap
