// A map's values at listed locations.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// nearest: the values of the closest map point. maximum: those of the point with the largest score
// within the radius (the closest of equals). mean: the mean of each field within the radius. Of map
// points that are equally good, the first in the map.
enum class LookupMode { nearest, maximum, mean };
const std::vector<std::pair<std::string, LookupMode>>& lookup_mode_names();

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

// |a - b|^2, the same to the bit wherever two points are compared.
inline double squared_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  // In the order of PointTree (nanoflann's L2_Simple_Adaptor).
  double sum = 0.0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return sum;
}

// One answer for each of `points`, which are in the map's frame. Throws Error for an empty map, a
// map without the field "score" where the mode needs it, and options out of their bounds.
std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options = {});

}  // namespace libgtd
