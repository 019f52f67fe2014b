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

// Returns true for the path of a tile store: the name ends with .tiles.
bool is_tile_store(const std::string& path);

std::filesystem::path store_index_path(const std::string& store);  // STORE/index.json

// Converts the manifest of a map in one file to the index of a tile store without tiles: sets
// lattice, frame and manifest. Returns nullopt if the manifest has no lattice.
std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest);

// Writes the file of one tile of the store, and sets path, hash and size of the file in `tile`.
void write_tile(const std::filesystem::path& store, const libmap::PointCloud& points,
                libgtd::StoredTile& tile);

// For a store without a plan, which cannot be resumed: throws Error if the store has an index.
void require_no_index(const libgtd::MapTileStore& store);

class MapTiles {
 public:
  // Throws Error naming store or index if one of them is missing, incomplete, damaged or empty.
  explicit MapTiles(const std::string& store);
  // Opens a store with an index that may not be written yet. Throws Error if it has no tiles.
  MapTiles(std::filesystem::path store, libgtd::TileStoreIndex index);

  const libgtd::TileStoreIndex& index() const { return index_; }

  // Returns the points of index().tiles[tile], with the same positions as in the merged map. Throws
  // Error naming the file if it is missing, damaged or differs from the index. Thread-safe.
  libmap::PointCloud load(std::size_t tile) const;
  // As load; also throws Error if the hash of the file differs from the index.
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

// Writes the tiles of a store as one map. PCD files are written one row of tiles at a time; other
// formats need the whole map in memory. Errors of merging name `store`.
void write_merged(const MapTiles& tiles, const std::string& store,
                  const std::filesystem::path& file, const libmap::GeometryWriteOptions& writing,
                  Run& run);

struct MergeOptions {
  libmap::GeometryWriteOptions writing;
  double pixel_size_m = 0.0;  // pixel size of a raster (.tif); 0: the voxel size
};

// Merges a tile store to a cloud, with the same bytes as if it had been scored into one file, or to
// a raster (.tif), with only the raster and a row of tiles in memory. Claims the output. Throws
// Error if the store is incomplete, or for a .pcd that is not binary.
void merge_store(const std::string& store, const std::string& output, const MergeOptions& options,
                 Run& run);

// Returns the raster of a map or cloud, whose points `parts` visits.
//
// The raster is in the CRS of the manifest's georeference; without one, in the frame of the points.
// Pixels are columns of voxels: the pixel axes are the lattice's x and y axes, projected to the
// horizontal plane. pixel_size_m 0: the map's voxel size; throws Error if the manifest has none.
// Also throws the errors of make_map_raster.
libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m);

// Writes the raster to `output`, which must be claimed. The run's manifest must already have frame,
// transforms and inputs. For a raster in a CRS, the transforms are removed from the manifest.
void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run);

}  // namespace graspmap_tools
