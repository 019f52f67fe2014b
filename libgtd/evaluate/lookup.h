// Looks up the values of a map at given locations, for example of a field test. The map is in
// memory or in tiles that are loaded one by one.
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

// Map points that determine the values at a location. nearest: the closest point. maximum: the
// point with the largest score within the radius (of equal scores, the closest). mean: all points
// within the radius, with the mean of each field. Of equally good points, the first one is used.
enum class LookupMode { nearest, maximum, mean };
std::vector<std::pair<std::string, LookupMode>> lookup_mode_names();

struct LookupOptions {
  LookupMode mode = LookupMode::nearest;
  double radius_m = 0.02;        // radius around the location (maximum, mean)
  double max_distance_m = 0.05;  // maximum distance of the closest point (nearest)
};
void bind(libmap::ParameterTable& table, LookupOptions& options);

struct LookupAnswer {
  bool found = false;
  double distance_m = 0.0;     // to the closest map point; infinity if the location is not finite
  std::size_t map_point = 0;   // point with the values; closest point for mean or if not found
  std::size_t map_points = 0;  // number of points that determine the values
  std::vector<double> values;  // one per field of the map; empty if not found
};

// Returns one answer per location in `points` (m, in the frame of the map). Throws Error for an
// empty map, a map without the field "score" if the mode needs it, and options out of range.
std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options = {});

// Loads the points of index.tiles[tile] in the frame of index.frame, in the order of to_cloud
// (graspability_map.h). Must be thread-safe.
using TileLoader = std::function<libmap::PointCloud(std::size_t tile)>;

// Returns the same answers as look_up over the whole map, except that `map_point` is an index
// within a tile. Sorts the locations by tile and processes about 10^5 at a time. Loads only tiles
// that are needed, few of them twice. Memory contains the answers and one tile per thread. Throws
// like look_up, and all errors of `load`.
std::vector<LookupAnswer> look_up_tiles(const TileStoreIndex& index, const TileLoader& load,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const LookupOptions& options = {},
                                        libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
