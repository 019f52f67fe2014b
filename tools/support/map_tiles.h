// Reads, fills and merges tile stores, and writes maps and clouds as GeoTIFF.
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
#include "libmap/raster/map_raster.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Returns true for paths of tile stores: names that end with .tiles.
bool is_tile_store(const std::string& path);

std::filesystem::path store_index_path(const std::string& store);  // STORE/index.json

// Converts the manifest of a map in one file to the index of a store: lattice, frame, transforms,
// no tiles. Returns nullopt if the manifest has no lattice.
std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest);

// Writes the file of one tile of the store, and adds hash and size of the file to `tile`.
void write_tile(const std::filesystem::path& store, const libmap::PointCloud& points,
                libgtd::StoredTile& tile);

// Throws Error if a store has an index. Called for a store without a plan, which has no progress.
void require_no_index(const libgtd::MapTileStore& store);

class MapTiles {
 public:
  // Throws Error naming the store or the index if either is missing, incomplete, damaged or empty.
  explicit MapTiles(const std::string& store);
  // Opens a store by an index that need not be written. Throws Error if it has no tiles.
  MapTiles(std::filesystem::path store, libgtd::TileStoreIndex index);

  const libgtd::TileStoreIndex& index() const { return index_; }

  // Returns the points of index().tiles[tile], with their positions in the merged map. Throws Error
  // naming the file if it is missing, damaged or differs from the index. Thread-safe.
  libmap::PointCloud load(std::size_t tile) const;
  // As load; also compares the hash of the file with the index.
  libmap::PointCloud load_checked(std::size_t tile) const;

  // Returns the bounding box of a tile's voxel centers, in the frame of the map's points.
  Eigen::AlignedBox3d box(std::size_t tile) const;
  // Returns true if the file of the merged map has positions in double precision.
  bool float64_positions() const { return float64_positions_; }

 private:
  bool need_float64() const;
  libmap::PointCloud read(const std::filesystem::path& file, const libgtd::StoredTile& tile) const;

  std::filesystem::path store_;
  libgtd::TileStoreIndex index_;
  bool float64_positions_ = false;
};

// Writes the tiles of a store as one map. PCD files are written row by row of tiles; other formats
// need the whole map in memory. Errors of merging name `store`.
void write_merged(const MapTiles& tiles, const std::string& store,
                  const std::filesystem::path& file, const libmap::GeometryWriteOptions& writing,
                  Run& run);

struct MergeOptions {
  libmap::GeometryWriteOptions writing;
  double pixel_size_m = 0.0;  // pixel size of a raster (.tif); 0: the voxel size
};

// Merges a tile store to a cloud, with the same bytes as if it had been scored into one file, or to
// a .tif with only the raster and a row of tiles in memory. Claims the output. Throws Error if the
// store is incomplete, or for .pcd that is not binary.
void merge_store(const std::string& store, const std::string& output, const MergeOptions& options,
                 Run& run);

// Returns the raster of a map or cloud, whose points `parts` visits.
//
// The raster is in the CRS of the manifest's georeference, else in the frame of the points. Pixels
// are columns of voxels: their axes are the lattice's x and y axes, projected to the horizontal
// plane. pixel_size_m 0: the map's voxel size; throws Error if the manifest has none. Throws also
// the errors of make_map_raster.
libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m);

// Writes the raster to `output`, which must be claimed. The run's manifest must already have frame,
// transforms and inputs; if the raster is in a CRS, the transforms are removed.
void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run);

}  // namespace graspmap_tools
