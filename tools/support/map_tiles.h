// Tile stores as commands read them.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"

namespace graspmap_tools {

// Whether commands take `path` for a tile store: its name ends in .tiles.
bool is_tile_store(const std::string& path);

std::filesystem::path store_index_path(const std::string& store);

// What the manifest of a map in one file says of it, as the index of a store: lattice, frame,
// transforms, no tiles. Nothing if it knows no lattice.
std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest);

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

}  // namespace graspmap_tools
