// A map's values at listed locations, of a whole map or of one in tiles that are loaded one by one.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/score/tile_store.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"

namespace libgtd {

// nearest: the values of the closest map point. maximum: those of the point with the largest score
// within the radius (the closest of equals). mean: the mean of each field within the radius. Of map
// points that are equally good, the first in the map.
enum class LookupMode { nearest, maximum, mean };
std::vector<std::pair<std::string, LookupMode>> lookup_mode_names();

struct LookupOptions {
  LookupMode mode = LookupMode::nearest;
  double radius_m = 0.02;        // of maximum and mean
  double max_distance_m = 0.05;  // of nearest: farther off there is nothing
};
void bind(libmap::ParameterTable& table, LookupOptions& options);

struct LookupAnswer {
  bool found = false;
  double distance_m = 0.0;     // to the nearest map point, found or not
  std::size_t map_point = 0;   // that the values are of; with mean the nearest
  std::size_t map_points = 0;  // that took part
  std::vector<double> values;  // one a field of the map; empty where nothing was found
};

// One answer for each of `points`, which are in the map's frame. Throws Error for an empty map, a
// map without the field "score" where the mode needs it, and options out of their bounds.
std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options = {});

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
