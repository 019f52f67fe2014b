#include "libgtd/score/tiling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "libgtd/streamed_detection.h"
#include "libmap/core/parallel.h"
#include "libmap/tiles/tile_share.h"
#include "tests/libgtd/score/score_test_support.h"

namespace libgtd {

bool operator==(const ScoredVoxel& a, const ScoredVoxel& b) {
  return a.voxel == b.voxel && a.counts == b.counts && a.score == b.score && a.border == b.border &&
         a.force.median_n == b.force.median_n && a.force.high_n == b.force.high_n;
}

namespace tiling_test {

using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using graspmap_test::random_engine;
using graspmap_test::random_ground;

class EachMethod : public testing::TestWithParam<Method> {};

INSTANTIATE_TEST_SUITE_P(All, EachMethod,
                         testing::Values(Method::thesis, Method::envelope, Method::climblab,
                                         Method::corrected, Method::calibrated),
                         [](const auto& given) { return name_of(given.param); });

// Property required for distributed scoring, over random scenes off the origin.
TEST_P(EachMethod, TilesOfAnySizeInAnyOrderGiveTheUntiledMap) {
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {GetParam(), 0.01, 1});
  for (int scene = 0; scene < 3; ++scene) {
    const VoxelGrid grid = grid_of(random_ground(70, -31 + 40 * scene, 12 - 57 * scene));
    const auto untiled = score_tiles(grid, mask, {graspmap_test::whole_box(grid)}, {});
    ASSERT_GT(untiled.size(), 1000U);
    for (const int tile_voxels : {1 << 20, 1000, 64, 37, 16, 5}) {
      std::vector<TileBounds> tiles = make_tiles(grid, tile_voxels);
      std::shuffle(tiles.begin(), tiles.end(), random_engine());
      for (const unsigned threads : {1U, 2U, 8U}) {
        const libmap::ThreadLimit limit(threads);
        EXPECT_TRUE(score_tiles(grid, mask, tiles, {}) == untiled)
            << tile_voxels << " voxels a tile, " << threads << " threads";
      }
    }
  }
}

TEST_P(EachMethod, SharesTogetherAreTheWholeMap) {
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {GetParam(), 0.01, 1});
  const VoxelGrid grid = grid_of(random_ground(60));
  const auto tiles = make_tiles(grid, 20);
  const auto whole = score_tiles(grid, mask, tiles, {});
  for (const int count : {1, 2, 5, 40}) {
    std::vector<ScoredVoxel> joined;
    for (int number = 1; number <= count; ++number) {
      const auto part = score_tiles(grid, mask, libmap::share_of(tiles, {number, count}), {});
      joined.insert(joined.end(), part.begin(), part.end());
    }
    std::sort(joined.begin(), joined.end(),
              [](const ScoredVoxel& a, const ScoredVoxel& b) { return a.voxel < b.voxel; });
    EXPECT_TRUE(joined == whole) << count << " shares";
  }
}

TEST(Tiles, CoverEachColumnOnce) {
  const VoxelGrid grid = grid_of({{-7, 3, 0}, {20, -11, 2}});
  std::map<std::pair<int, int>, int> covered;
  for (const TileBounds& tile : make_tiles(grid, 6)) {
    // Borders inside the grid are on the lattice of tiles.
    EXPECT_TRUE(tile.i_begin % 6 == 0 || tile.i_begin == grid.min.i);
    EXPECT_TRUE(tile.j_end % 6 == 0 || tile.j_end == grid.max.j + 1);
    for (int i = tile.i_begin; i < tile.i_end; ++i)
      for (int j = tile.j_begin; j < tile.j_end; ++j) ++covered[{i, j}];
  }
  for (int i = grid.min.i; i <= grid.max.i; ++i)
    for (int j = grid.min.j; j <= grid.max.j; ++j) EXPECT_EQ((covered[{i, j}]), 1);
}

TEST(Tiles, TooManyAreAnError) {
  const VoxelGrid grid = grid_of({{0, 0, 0}, {100000, 100000, 0}});
  const libmap::Error error = graspmap_test::error_of([&] { make_tiles(grid, 1); });
  EXPECT_EQ(error.context().field, "tile_size_m");
}

// Chebyshev distances to occupied columns, column by column.
bool is_scanned_plainly(const std::vector<Voxel>& voxels, int i, int j) {
  const auto near_occupied = [&](int a, int b) {
    return std::any_of(voxels.begin(), voxels.end(), [&](const Voxel& voxel) {
      return std::max(std::abs(voxel.i - a), std::abs(voxel.j - b)) <= scan_gap_voxels;
    });
  };
  for (int a = i - scan_gap_voxels; a <= i + scan_gap_voxels; ++a)
    for (int b = j - scan_gap_voxels; b <= j + scan_gap_voxels; ++b)
      if (!near_occupied(a, b)) return false;
  return true;
}

TEST(Edges, AgreeWithThePlainClosing) {
  std::vector<Voxel> voxels;
  for (int i = 0; i < 44; ++i)
    for (int j = 0; j < 40; ++j)
      // A hole of 9 x 9 columns near a corner is too wide for a gap between points.
      if (!(i > 30 && i < 40 && j > 27 && j < 37) && graspmap_test::uniform(0, 1) < 0.5)
        voxels.push_back({i, j, 0});
  const VoxelGrid grid = grid_of(voxels);
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {Method::corrected, 0.02, 1});
  const TileBounds box = graspmap_test::whole_box(grid);
  const auto pivots = pivots_in(grid, mask, box);
  const auto edges = find_border_pivots(grid, mask, box, pivots);
  std::map<std::pair<int, int>, bool> scanned;
  for (int i = -10; i < 56; ++i)
    for (int j = -10; j < 52; ++j) scanned[{i, j}] = is_scanned_plainly(grid.voxels, i, j);
  std::size_t flagged = 0;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& pivot = grid.voxels[pivots[n]];
    bool leaves = false;
    for (int x = -mask.pivot_xy; x <= mask.pivot_xy; ++x)
      for (int y = -mask.pivot_xy; y <= mask.pivot_xy; ++y)
        leaves = leaves || !scanned[{pivot.i + x, pivot.j + y}];
    EXPECT_EQ(edges[n] != 0, leaves) << pivot.i << " " << pivot.j;
    flagged += edges[n];
  }
  EXPECT_GT(flagged, 100U);
  EXPECT_LT(flagged, pivots.size() - 100);
}

// A tile much wider than its ground gives the same result as one table over all of it.
TEST(Edges, OfAWideTileWithLittleGround) {
  std::vector<Voxel> voxels;
  for (const Voxel& corner : {Voxel{0, 0, 0}, Voxel{2000, 5, 0}, Voxel{1010, 1015, 0}})
    for (int i = 0; i < 40; ++i)
      for (int j = 0; j < 40; ++j)
        if (graspmap_test::uniform(0, 1) < 0.7)
          voxels.push_back({corner.i + i, corner.j + j, corner.k});
  const VoxelGrid grid = grid_of(voxels);
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {Method::corrected, 0.02, 1});
  const TileBounds box = graspmap_test::whole_box(grid);
  const auto pivots = pivots_in(grid, mask, box);
  const auto edges = find_border_pivots(grid, mask, box, pivots);
  const ColumnSums unscanned =
      unscanned_columns(grid, expanded(box, mask.pivot_xy, mask.side - mask.pivot_xy - 1));
  ASSERT_EQ(edges.size(), pivots.size());
  std::size_t flagged = 0;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& pivot = grid.voxels[pivots[n]];
    const auto window =
        columns_around(pivot.i, pivot.j, mask.pivot_xy, mask.side - mask.pivot_xy - 1);
    EXPECT_EQ(edges[n] != 0, unscanned.count(window) != 0);
    flagged += edges[n];
  }
  EXPECT_GT(flagged, 100U);
  EXPECT_LT(flagged, pivots.size() - 100);
}

TEST(StoredTiles, TooManyAreAnError) {
  TerrainFrame frame;
  frame.max = {1023, 1023, 0};
  EXPECT_EQ(tiles_of(frame, 1).size(), std::size_t{1} << 20U);
  frame.max.j = 1024;
  const libmap::Error error = graspmap_test::error_of([&] { tiles_of(frame, 1); });
  EXPECT_EQ(error.context().field, "tile_size_m");
  EXPECT_TRUE(graspmap_test::is_error(error, {.field = "tile_size_m", .value = "0.01"}));
}

// Tiles are processed in parts even if they have few points.
TEST(StoredTiles, NotAllAtOnce) {
  TerrainFrame frame;
  frame.max = {14999, 14999, 0};
  DetectionOptions options;
  options.gripper = gripper_named("scar-e");
  const std::vector<TileNumber> wanted = tiles_of(frame, 100);
  ASSERT_EQ(wanted.size(), 22500U);
  const libmap::PointTileStore no_points(graspmap_test::scratch_folder(), {});
  std::vector<TileNumber> visited;
  std::size_t most = 0;
  detect_streamed(frame, no_points, wanted, options, [&](std::vector<StreamedTile> tiles) {
    most = std::max(most, tiles.size());
    for (const StreamedTile& tile : tiles) visited.push_back(tile.number);
  });
  std::sort(visited.begin(), visited.end());
  EXPECT_EQ(visited, wanted);
  EXPECT_LE(most, 16384U);
}

}  // namespace tiling_test
}  // namespace libgtd
