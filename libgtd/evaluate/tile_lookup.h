// A map's values at listed locations, of a map in tiles that are loaded one by one.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "libgtd/evaluate/lookup.h"
#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"

namespace libgtd {

// The points of index.tiles[tile], in the frame of index.frame, as to_cloud orders them. Called
// from several threads at once.
using TileLoader = std::function<libmap::PointCloud(std::size_t tile)>;

// The answers of look_up over the whole map; `map_point` counts within its tile. Points are taken
// by their tiles, some 10^5 at a time, so that no tile is loaded that no point needs, few twice,
// and memory holds a tile a thread besides the answers. Throws Error as look_up does, and what
// `load` throws.
std::vector<LookupAnswer> look_up_tiles(const TileStoreIndex& index, const TileLoader& load,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const LookupOptions& options = {},
                                        libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
