#include "libmap/tiles/point_tile_store.h"

#include <gtest/gtest.h>

#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace point_tile_store_test {

using Eigen::Vector2d;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using libmap::PointCloud;
using libmap::PointTileStore;

// Compares with a filter in memory for several sizes of the buffer.
TEST(PointTileStore, PointsOfARectangleInTheirOrder) {
  for (const std::size_t buffer : {std::size_t{100}, std::size_t{20000}, std::size_t{1} << 26U}) {
    for (const bool normals : {false, true}) {
      PointTileStore store(scratch_folder(),
                           {.tile_m = 0.7, .has_normals = normals, .buffer_bytes = buffer});
      PointCloud all;
      for (int part = 0; part < 3; ++part) {
        PointCloud cloud;
        for (int n = 0; n < 700; ++n) {
          cloud.positions.emplace_back(uniform(-5, 5), uniform(-5, 5), uniform(-1, 1));
          if (normals) cloud.normals.emplace_back(static_cast<float>(n), 0.0F, 1.0F);
        }
        store.add(cloud);
        all.positions.insert(all.positions.end(), cloud.positions.begin(), cloud.positions.end());
        all.normals.insert(all.normals.end(), cloud.normals.begin(), cloud.normals.end());
      }
      if (buffer == 100) store.finish();
      EXPECT_EQ(store.size(), 2100u);
      for (int trial = 0; trial < 20; ++trial) {
        const Vector2d low(uniform(-6, 5), uniform(-6, 5));
        const Vector2d high = low + Vector2d(uniform(0, 4), uniform(0, 4));
        std::vector<std::size_t> inside;
        for (std::size_t n = 0; n < all.size(); ++n) {
          const auto place = all.positions[n].head<2>().array();
          if ((place >= low.array()).all() && (place <= high.array()).all()) inside.push_back(n);
        }
        const PointCloud expected = libmap::select_points(all, inside);
        const PointCloud found = store.points_in(low, high);
        EXPECT_EQ(found.positions, expected.positions);
        EXPECT_EQ(found.normals, expected.normals);
        EXPECT_GE(store.count_in(low, high), inside.size());
      }
    }
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch_folder()));
}

TEST(PointTileStore, FolderThatIsNotThere) {
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { PointTileStore(scratch_folder() / "none", {}); }),
      {.file = scratch_folder() / "none", .kind = libmap::ErrorKind::failed}));
}

}  // namespace point_tile_store_test
