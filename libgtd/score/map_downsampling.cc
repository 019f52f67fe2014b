#include "libgtd/score/map_downsampling.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

namespace {

// Twice the distance of a column from the middle of its square, along one axis.
std::int64_t off_middle(int column, int square, int width) {
  return std::abs(2 * (column - std::int64_t{square} * width) - (width - 1));
}

// Keeps the point nearest to the middle of each square of columns, or with `by_layers` of each
// cube; the highest of equally near ones.
libmap::PointCloud thin(const libmap::PointCloud& map, int width, bool by_layers) {
  const VoxelFields voxels(map);
  struct Candidate {
    TileNumber square;
    int layer = 0;
    std::int64_t off_middle = 0;
    int below_top = 0;
    std::size_t point = 0;
    auto operator<=>(const Candidate&) const = default;
  };
  std::vector<Candidate> candidates(map.size());
  for (std::size_t n = 0; n < map.size(); ++n) {
    const Voxel voxel = voxels.at(n);
    const TileNumber square = tile_of(voxel, width);
    const int layer = by_layers ? tile_of({voxel.k, 0, 0}, width).i : 0;
    const std::int64_t x = off_middle(voxel.i, square.i, width);
    const std::int64_t y = off_middle(voxel.j, square.j, width);
    const std::int64_t z = by_layers ? off_middle(voxel.k, layer, width) : 0;
    candidates[n] = {square, layer, x * x + y * y + z * z, -voxel.k, n};
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<std::size_t> kept;
  for (std::size_t n = 0; n < candidates.size(); ++n)
    if (n == 0 || candidates[n].square != candidates[n - 1].square ||
        candidates[n].layer != candidates[n - 1].layer)
      kept.push_back(candidates[n].point);
  return libmap::select_points(map, kept);
}

}  // namespace

libmap::PointCloud downsample_map(const libmap::PointCloud& map, int width) {
  return thin(map, width, false);
}

libmap::PointCloud voxel_downsample_map(const libmap::PointCloud& map, int width) {
  return thin(map, width, true);
}

void snap_to_square_centers(const TileStoreIndex& index, int width, libmap::PointCloud& map) {
  const VoxelFields voxels(map);
  const libmap::Pose terrain_from_map = index.frame == MapFrame::input
                                            ? index.terrain_from_input()
                                            : libmap::Pose(libmap::Pose::Identity());
  const libmap::Pose map_from_terrain = terrain_from_map.inverse();
  for (std::size_t n = 0; n < map.size(); ++n) {
    const Voxel voxel = voxels.at(n);
    const TileNumber square = tile_of(voxel, width);
    const Eigen::Vector3d cell(width * (square.i + 0.5), width * (square.j + 0.5), voxel.k + 0.5);
    map.positions[n] =
        map_from_terrain * (index.lattice.origin_m + index.lattice.voxel_size_m * cell);
  }
}

}  // namespace libgtd
