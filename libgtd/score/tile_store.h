// A map in tiles, as plain data: what the index of a tile store says. A store is a folder
// NAME.tiles with an index and one cloud file per tile, each a part of the map as to_cloud makes
// it; tile_store_io.h reads and writes it.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/manifest.h"

namespace libgtd {

// A tile's place on the lattice of tiles: tile (i, j) holds the voxels whose i and j, divided by
// the tile's width and rounded down, are these.
struct TileNumber {
  int i = 0;
  int j = 0;
  auto operator<=>(const TileNumber&) const = default;
};
TileNumber tile_of(const Voxel& voxel, int tile_voxels);
TileBounds columns_of(const TileNumber& tile, int tile_voxels);  // not cut to the terrain's box
std::string tile_file_of(const TileNumber& tile);                // "tiles/-3_12.pcd"

// Grows the box until it contains the voxel.
void extend(const Voxel& voxel, Voxel& min, Voxel& max);

struct StoredTile {
  TileNumber number;
  Voxel min;  // box of its voxels
  Voxel max;
  std::uint64_t voxels = 0;  // scored ones; a tile without any has no file and is not listed
  std::uint64_t occupied_voxels = 0;
  std::uint64_t border_voxels = 0;
  std::uint64_t graspable_voxels = 0;
  std::string file;  // in the store
  std::uint64_t bytes = 0;
  std::string sha256;  // of the file
};

struct TileStoreIndex {
  std::string key;       // of parameters and inputs: the same key, the same map
  VoxelLattice lattice;  // in the terrain frame
  int tile_voxels = 0;   // width of a tile
  Voxel min;             // box of the terrain's voxels
  Voxel max;
  MapFrame frame = MapFrame::terrain;  // of the points in the tiles' files
  // Command, parameters, inputs, transforms and counts of the whole map, as beside any map.
  libmap::Manifest manifest;
  std::vector<StoredTile> tiles;  // ascending by number

  // The identity if no plane was fitted.
  libmap::Pose terrain_from_input() const;
  // Nothing if there is no such tile.
  const StoredTile* find(const TileNumber& tile) const;
  std::uint64_t voxels() const;
  std::uint64_t border_voxels() const;
  std::uint64_t graspable_voxels() const;
};

// The positions of `tile`'s points from their fields i, j, k, in full precision: a tile's file has
// them in single precision, if that is enough for the tile by itself. Throws Error for a cloud
// without these fields.
void restore_positions(const TileStoreIndex& index, libmap::PointCloud& tile);

}  // namespace libgtd
