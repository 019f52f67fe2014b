// The shares of a map, or the tiles of a store, as one map.
#pragma once

#include "libmap/cloud/cloud_io.h"
#include "tools/support/map_tiles.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// A tile store, or one of several shares of a map by its manifest.
bool is_part_of_map(const std::string& file);

// Writes the tiles of a store as one map, a PCD row by row of tiles; other formats need the whole
// map in memory. Errors name `store`.
void write_merged(const MapTiles& tiles, const std::string& store,
                  const std::filesystem::path& file, const libmap::CloudWriteOptions& writing,
                  Run& run);

struct MergeOptions {
  libmap::CloudWriteOptions writing;
  double pixel_size_m = 0.0;  // of a raster, .tif; 0: the voxel size
};

// Writes the same bytes as scoring in one run. `tiles` are all shares that `score --tile K/N`
// wrote, in any order, or one tile store, which is merged row by row of tiles. Throws Error if a
// share is missing, given twice, or of another map.
// A store is written as binary .pcd, in another format, or as .tif (the raster alone is in memory).
void merge_tiles(const std::vector<std::string>& tiles, const std::string& output,
                 const MergeOptions& options, Run& run);

}  // namespace graspmap_tools
