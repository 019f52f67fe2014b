// Looks up the values of a map at given locations, such as tested locations, for a map in memory or
// in tiles that are loaded one by one.
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

// nearest: values of the closest map point. maximum: values of the point with the largest score
// within the radius (the closest of equal ones). mean: mean of each field within the radius. Of
// points that are still equal, the first in the map is used.
enum class LookupMode { nearest, maximum, mean };
std::vector<std::pair<std::string, LookupMode>> lookup_mode_names();

struct LookupOptions {
  LookupMode mode = LookupMode::nearest;
  double radius_m = 0.02;        // for maximum and mean
  double max_distance_m = 0.05;  // for nearest: maximum distance of the point
};
void bind(libmap::ParameterTable& table, LookupOptions& options);

struct LookupAnswer {
  bool found = false;
  double distance_m = 0.0;     // to the nearest map point; infinity for a point that is not finite
  std::size_t map_point = 0;   // source of the values; with mean the nearest point
  std::size_t map_points = 0;  // number of points that contributed
  std::vector<double> values;  // one per field of the map; empty if not found
};

// Returns one answer per point; `points` are in the frame of the map. Throws Error for an empty
// map, a map without the field "score" if the mode needs it, and options out of range.
std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options = {});

// Loads the points of index.tiles[tile] in the frame of index.frame, in the order of to_cloud
// (graspability_map.h). Must be thread-safe.
using TileLoader = std::function<libmap::PointCloud(std::size_t tile)>;

// Returns the answers of look_up over the whole map, except that `map_point` is an index within a
// tile. Points are sorted by tile, about 10^5 at a time. Only required tiles are loaded, few of
// them twice; memory contains the answers and one tile per thread. Throws like look_up, and all
// errors of `load`.
std::vector<LookupAnswer> look_up_tiles(const TileStoreIndex& index, const TileLoader& load,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const LookupOptions& options = {},
                                        libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
