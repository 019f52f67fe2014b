// What the commands share that fill a tile store, share by share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libgtd/score/tile_progress_io.h"
#include "libgtd/score/tiling.h"
#include "libmap/core/point_cloud.h"

namespace graspmap_tools {

// "K/N". Throws Error naming --tile.
libgtd::TileShare parse_share(const std::string& text);

// Those without a file that is as it was written.
std::vector<libgtd::TileNumber> missing_tiles(const libgtd::TileProgress& progress,
                                              const libgtd::TilePlan& plan,
                                              const std::vector<libgtd::TileNumber>& tiles);

// Writes the file of a tile, unless it has no points, and adds what is known of the file.
void write_tile(const libgtd::TileProgress& progress, const libmap::PointCloud& points,
                libgtd::StoredTile& tile);

}  // namespace graspmap_tools
