#include "libgtd/store_plan.h"

#include <gtest/gtest.h>

namespace libgtd {
namespace store_plan_test {

StoreTiling tiling_of_10_voxels(int halo) {
  DetectionOptions options;
  options.scenario.voxel_size_m = 0.01;
  options.scenario.tile_size_m = 0.1;
  StoreTiling tiling(options);
  tiling.halo_voxels = halo;
  return tiling;
}

TEST(StorePlan, TheRectangleContainsTheHaloOfEachTile) {
  TerrainFrame frame;
  frame.lattice.voxel_size_m = 0.01;
  const StoreTiling tiling = tiling_of_10_voxels(3);
  const PointsRectangle rectangle = points_for({{0, 2}, {-1, 5}, {3, 4}}, frame, tiling);
  // One voxel of margin.
  EXPECT_NEAR(rectangle.low.x(), -0.14, 1e-12);
  EXPECT_NEAR(rectangle.low.y(), 0.16, 1e-12);
  EXPECT_NEAR(rectangle.high.x(), 0.44, 1e-12);
  EXPECT_NEAR(rectangle.high.y(), 0.64, 1e-12);
}

TEST(StorePlan, FilesThatTouchARectangle) {
  TerrainFrame frame;
  const PointsRectangle rectangle{{0.0, 0.0}, {1.0, 2.0}};
  TerrainFile file;
  file.points = 1;
  const auto touches_at = [&](double x, double y) {
    file.box.min = Eigen::Vector3d(x, y, -1);
    file.box.max = Eigen::Vector3d(x + 0.5, y + 0.5, 1);
    return may_intersect(file, rectangle, frame);
  };
  EXPECT_TRUE(touches_at(0.2, 0.2));
  EXPECT_TRUE(touches_at(-0.505, 2.005));
  EXPECT_FALSE(touches_at(-0.52, 0.2));
  EXPECT_FALSE(touches_at(1.02, 0.2));
  EXPECT_FALSE(touches_at(0.2, -0.52));
  EXPECT_FALSE(touches_at(0.2, 2.02));
  file.box.min = Eigen::Vector3d::Constant(-1e300);
  file.box.max = Eigen::Vector3d::Constant(1e300);
  EXPECT_TRUE(may_intersect(file, rectangle, frame));
  // In the terrain frame.
  frame.plane = RegressionPlane{};
  frame.plane->centroid.x() = -5.0;
  EXPECT_TRUE(touches_at(-4.9, 0.2));
  EXPECT_FALSE(touches_at(0.2, 0.2));
  file.points = 0;
  EXPECT_FALSE(touches_at(-4.9, 0.2));
}

TEST(StoredTile, CountsItsVoxels) {
  StreamedTile tile{.number = {2, -1}, .voxels = {}, .occupied_voxels = 9};
  EXPECT_EQ(stored_tile(tile).voxels, 0u);
  EXPECT_EQ(stored_tile(tile).occupied_voxels, 9u);
  const auto voxel = [](const Voxel& at, bool graspable) {
    MapVoxel one;
    one.voxel = at;
    one.graspable = graspable;
    one.border = true;
    return one;
  };
  tile.voxels = {voxel({20, -5, 3}, true), voxel({21, -7, 2}, false)};
  const StoredTile stored = stored_tile(tile);
  EXPECT_EQ(stored.number, (TileNumber{2, -1}));
  EXPECT_EQ(stored.min, (Voxel{20, -7, 2}));
  EXPECT_EQ(stored.max, (Voxel{21, -5, 3}));
  EXPECT_EQ(stored.voxels, 2u);
  EXPECT_EQ(stored.border_voxels, 2u);
  EXPECT_EQ(stored.graspable_voxels, 1u);
}

}  // namespace store_plan_test
}  // namespace libgtd
