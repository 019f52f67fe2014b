// Tile stores, and shares of maps, as commands read, fill and merge them.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/tile_store_io.h"
#include "libmap/core/point_cloud.h"
#include "libmap/io/cloud_io.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Whether commands take `path` for a tile store: its name ends in .tiles.
bool is_tile_store(const std::string& path);

std::filesystem::path store_index_path(const std::string& store);

// What the manifest of a map in one file says of it, as the index of a store: lattice, frame,
// transforms, no tiles. Nothing if it knows no lattice.
std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest);

// Writes the file of a tile of the store, and adds facts on the file to the tile.
void write_tile(const std::filesystem::path& store, const libmap::PointCloud& points,
                libgtd::StoredTile& tile);

// Throws Error if a store has an index but no plan to resume by.
void require_no_index(const libgtd::MapTileStore& store);

class MapTiles {
 public:
  // Throws Error naming the store or its index: missing, incomplete, damaged, without a tile.
  explicit MapTiles(const std::string& store);
  // Of a store whose index is not written.
  MapTiles(std::filesystem::path store, libgtd::TileStoreIndex index);

  const libgtd::TileStoreIndex& index() const { return index_; }

  // A tile's points at the positions that the file of the merged map has. Throws Error naming the
  // tile's file: it is missing, damaged, or does not hold what the index says. May be called from
  // several threads.
  libmap::PointCloud load(std::size_t tile) const;
  // The same, and the file's hash is compared with the index.
  libmap::PointCloud load_checked(std::size_t tile) const;

  // Around the centers of a tile's voxels, in the frame of the map's points.
  Eigen::AlignedBox3d box(std::size_t tile) const;
  // Whether the file of the merged map holds positions in double precision.
  bool float64_positions() const { return float64_positions_; }

 private:
  bool need_float64() const;
  libmap::PointCloud read(const std::filesystem::path& file, const libgtd::StoredTile& tile) const;

  std::filesystem::path store_;
  libgtd::TileStoreIndex index_;
  bool float64_positions_ = false;
};

// A tile store, or one of several shares of a map by its manifest.
bool is_part_of_map(const std::string& file);

// Writes the tiles of a store as one map, a PCD row by row of tiles; other formats need the whole
// map in memory. Errors name `store`.
void write_merged(const MapTiles& tiles, const std::string& store,
                  const std::filesystem::path& file, const libmap::GeometryWriteOptions& writing,
                  Run& run);

struct MergeOptions {
  libmap::GeometryWriteOptions writing;
  double pixel_size_m = 0.0;  // of a raster, .tif; 0: the voxel size
};

// Writes the same bytes as scoring in one run. `tiles` are all shares that `score --tile K/N`
// wrote, in any order, or one tile store, which is merged row by row of tiles. Throws Error if a
// share is missing, given twice, or of another map.
// A store is written as binary .pcd, in another format, or as .tif (the raster alone is in memory).
void merge_tiles(const std::vector<std::string>& tiles, const std::string& output,
                 const MergeOptions& options, Run& run);

}  // namespace graspmap_tools
