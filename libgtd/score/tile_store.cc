#include "libgtd/score/tile_store.h"

#include <algorithm>

#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

TileNumber tile_of(const Voxel& voxel, int tile_voxels) {
  return {floor_divide(voxel.i, tile_voxels), floor_divide(voxel.j, tile_voxels)};
}

TileBounds columns_of(const TileNumber& tile, int tile_voxels) {
  return {tile.i * tile_voxels, (tile.i + 1) * tile_voxels, tile.j * tile_voxels,
          (tile.j + 1) * tile_voxels};
}

std::string tile_file_of(const TileNumber& tile) {
  return "tiles/" + std::to_string(tile.i) + "_" + std::to_string(tile.j) + ".pcd";
}

void extend(const Voxel& voxel, Voxel& min, Voxel& max) {
  min = {std::min(min.i, voxel.i), std::min(min.j, voxel.j), std::min(min.k, voxel.k)};
  max = {std::max(max.i, voxel.i), std::max(max.j, voxel.j), std::max(max.k, voxel.k)};
}

libmap::Pose TileStoreIndex::terrain_from_input() const {
  const libmap::Pose* pose = manifest.find_transform("terrain_from_input");
  return pose == nullptr ? libmap::Pose::Identity() : *pose;
}

const StoredTile* TileStoreIndex::find(const TileNumber& tile) const {
  const auto found = std::lower_bound(
      tiles.begin(), tiles.end(), tile,
      [](const StoredTile& one, const TileNumber& number) { return one.number < number; });
  return found != tiles.end() && found->number == tile ? &*found : nullptr;
}

namespace {

std::uint64_t sum_of(const std::vector<StoredTile>& tiles, const auto& count) {
  std::uint64_t sum = 0;
  for (const StoredTile& tile : tiles) sum += tile.*count;
  return sum;
}

}  // namespace

std::uint64_t TileStoreIndex::voxels() const { return sum_of(tiles, &StoredTile::voxels); }
std::uint64_t TileStoreIndex::border_voxels() const {
  return sum_of(tiles, &StoredTile::border_voxels);
}
std::uint64_t TileStoreIndex::graspable_voxels() const {
  return sum_of(tiles, &StoredTile::graspable_voxels);
}

void restore_positions(const TileStoreIndex& index, libmap::PointCloud& tile) {
  const VoxelFields voxels(tile);
  const libmap::Pose input_from_terrain = index.terrain_from_input().inverse();
  for (std::size_t n = 0; n < tile.size(); ++n) {
    const Eigen::Vector3d center = index.lattice.center_of(voxels.at(n));
    tile.positions[n] = index.frame == MapFrame::input ? input_from_terrain * center : center;
  }
}

}  // namespace libgtd
