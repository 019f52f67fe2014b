// Index of a map in a tile store: a folder NAME.tiles with one cloud file per tile, each a part of
// the map as made by to_cloud. Plain data; tile_store_io.h reads and writes it.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/manifest.h"

namespace libgtd {

// Index of a tile on the lattice of tiles: i and j of the tile's voxels, divided by the tile width
// and rounded down.
struct TileNumber {
  int i = 0;
  int j = 0;
  auto operator<=>(const TileNumber&) const = default;
};
TileNumber tile_of(const Voxel& voxel, int tile_voxels);         // tile that contains the voxel
TileBounds columns_of(const TileNumber& tile, int tile_voxels);  // not clipped to the terrain
std::string tile_file_of(const TileNumber& tile);                // "tiles/-3_12.pcd"

// Extends the box to contain the voxel.
void extend(const Voxel& voxel, Voxel& min, Voxel& max);

struct StoredTile {
  TileNumber number;
  Voxel min;  // box of the scored voxels
  Voxel max;
  std::uint64_t voxels = 0;  // scored voxels; a tile without them has no file and is not listed
  std::uint64_t occupied_voxels = 0;
  std::uint64_t border_voxels = 0;
  std::uint64_t graspable_voxels = 0;
  std::string file;  // path in the store
  std::uint64_t bytes = 0;
  std::string sha256;  // SHA-256 of the file
};

struct TileStoreIndex {
  std::string key;       // hash of parameters and inputs; identifies the map
  VoxelLattice lattice;  // in the terrain frame
  int tile_voxels = 0;   // width of a tile, in voxels
  Voxel min;             // box of the terrain's voxels
  Voxel max;
  MapFrame frame = MapFrame::terrain;  // frame of the points in the tile files
  // Manifest of the whole map: command, parameters, inputs, transforms and counts.
  libmap::Manifest manifest;
  std::vector<StoredTile> tiles;  // ascending by number

  // Transform from the input frame to the terrain frame; identity if no plane was fitted.
  libmap::Pose terrain_from_input() const;
  // Returns nullptr if the store does not contain the tile.
  const StoredTile* find(const TileNumber& tile) const;
  std::uint64_t voxels() const;
  std::uint64_t border_voxels() const;
  std::uint64_t graspable_voxels() const;
};

// Recomputes the positions of the points of `tile` from the fields i, j, k in double precision,
// because tile files may contain single precision. Throws Error for a cloud without these fields.
void restore_positions(const TileStoreIndex& index, libmap::PointCloud& tile);

}  // namespace libgtd
