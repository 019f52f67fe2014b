#include "libgtd/evaluate/lookup.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libgtd/terrain/voxel_fields.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/spatial_index.h"

namespace libgtd {

namespace {

std::vector<double> point_values(const libmap::PointCloud& map, std::size_t point) {
  std::vector<double> values;
  for (const libmap::ScalarField& field : map.fields) values.push_back(field.values[point]);
  return values;
}

std::vector<double> mean_values(const libmap::PointCloud& map,
                                const std::vector<std::size_t>& points) {
  std::vector<double> values;
  for (const libmap::ScalarField& field : map.fields) {
    double sum = 0.0;
    for (const std::size_t n : points) sum += field.values[n];
    values.push_back(sum / static_cast<double>(points.size()));
  }
  return values;
}

std::size_t best_of(const libmap::PointCloud& map, const std::vector<double>& scores,
                    const std::vector<std::size_t>& points, const Eigen::Vector3d& at) {
  const auto rank = [&](std::size_t n) {
    return std::pair(-scores[n], squared_distance(map.positions[n], at));
  };
  return *std::min_element(points.begin(), points.end(),
                           [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
}

void check(const libmap::PointCloud& map, const LookupOptions& options) {
  libmap::check_parameters(options);
  if (map.empty()) throw libmap::Error("the map has no points");
  if (options.mode == LookupMode::maximum) values_of(map, "score");
}

LookupAnswer answer_of(const libmap::PointCloud& map, const libmap::PointTree& tree,
                       const Eigen::Vector3d& at, const LookupOptions& options) {
  LookupAnswer answer;
  if (!at.allFinite()) {
    answer.distance_m = HUGE_VAL;
    return answer;
  }
  const libmap::NeighborPoint nearest = tree.first_of_nearest(at);
  answer.map_point = nearest.index;
  answer.distance_m = std::sqrt(nearest.square_m2);
  if (options.mode == LookupMode::nearest) {
    answer.found = answer.distance_m <= options.max_distance_m;
    if (!answer.found) return answer;
    answer.map_points = 1;
    answer.values = point_values(map, answer.map_point);
    return answer;
  }
  // By index, so that a mean does not depend on the tree's order.
  std::vector<std::size_t> points;
  for (const libmap::NeighborPoint& near : tree.within(at, options.radius_m))
    points.push_back(near.index);
  answer.map_points = points.size();
  answer.found = !points.empty();
  if (!answer.found) return answer;
  if (options.mode == LookupMode::mean) {
    answer.values = mean_values(map, points);
  } else {
    answer.map_point = best_of(map, map.find_field("score")->values, points, at);
    answer.values = point_values(map, answer.map_point);
  }
  return answer;
}

}  // namespace

const std::vector<std::pair<std::string, LookupMode>>& lookup_mode_names() {
  static const std::vector<std::pair<std::string, LookupMode>> names = {
      {"nearest", LookupMode::nearest},
      {"maximum", LookupMode::maximum},
      {"mean", LookupMode::mean}};
  return names;
}

void bind(libmap::ParameterTable& table, LookupOptions& options) {
  table.add("mode", options.mode, lookup_mode_names(),
            "which map points answer: the closest, the best or all within the radius");
  table.add("radius_m", options.radius_m, libmap::positive, "radius of maximum and mean, m");
  table.add("max_distance_m", options.max_distance_m, libmap::positive,
            "nearest: farther off there is nothing, m");
}

std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options) {
  check(map, options);
  const libmap::PointTree tree(map.positions);
  std::vector<LookupAnswer> answers(points.size());
  libmap::parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) answers[n] = answer_of(map, tree, points[n], options);
  });
  return answers;
}

}  // namespace libgtd
