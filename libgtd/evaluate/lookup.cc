#include "libgtd/evaluate/lookup.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

struct Points {
  const std::vector<Eigen::Vector3d>& positions;
  std::size_t kdtree_get_point_count() const { return positions.size(); }
  double kdtree_get_pt(std::size_t n, std::size_t axis) const {
    return positions[n][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Points>,
                                                 Points, 3, std::size_t>;

std::vector<double> values_of(const libmap::PointCloud& map, std::size_t point) {
  std::vector<double> values;
  for (const libmap::ScalarField& field : map.fields) values.push_back(field.values[point]);
  return values;
}

// Points within the radius by index, so that a mean does not depend on the tree's order.
std::vector<std::size_t> points_within(const Tree& tree, const Eigen::Vector3d& point,
                                       double radius_m) {
  std::vector<std::pair<std::size_t, double>> matches;
  // The tree counts distances < r; a point at the radius itself belongs to it.
  const double reach = std::nextafter(radius_m * radius_m, HUGE_VAL);
  tree.radiusSearch(point.data(), reach, matches, nanoflann::SearchParams());
  std::vector<std::size_t> indices;
  for (const auto& [index, squared] : matches) indices.push_back(index);
  std::sort(indices.begin(), indices.end());
  return indices;
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
    return std::pair(-scores[n], (map.positions[n] - at).squaredNorm());
  };
  return *std::min_element(points.begin(), points.end(),
                           [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
}

void check(const libmap::PointCloud& map, const LookupOptions& options) {
  LookupOptions copy = options;
  libmap::ParameterTable table;
  bind(table, copy);
  for (const libmap::Parameter& parameter : table.parameters()) parameter.set(parameter.get());
  if (map.empty()) throw libmap::Error("the map has no points");
  if (options.mode == LookupMode::maximum && map.find_field("score") == nullptr)
    throw libmap::Error("the map has no such field", {.field = "score"});
}

LookupAnswer answer_of(const libmap::PointCloud& map, const Tree& tree, const Eigen::Vector3d& at,
                       const LookupOptions& options) {
  LookupAnswer answer;
  if (!at.allFinite()) {
    answer.distance_m = HUGE_VAL;
    return answer;
  }
  double squared = 0.0;
  tree.knnSearch(at.data(), 1, &answer.map_point, &squared);
  answer.distance_m = std::sqrt(squared);
  if (options.mode == LookupMode::nearest) {
    answer.found = answer.distance_m <= options.max_distance_m;
    if (!answer.found) return answer;
    answer.map_points = 1;
    answer.values = values_of(map, answer.map_point);
    return answer;
  }
  const std::vector<std::size_t> points = points_within(tree, at, options.radius_m);
  answer.map_points = points.size();
  answer.found = !points.empty();
  if (!answer.found) return answer;
  if (options.mode == LookupMode::mean) {
    answer.values = mean_values(map, points);
  } else {
    answer.map_point = best_of(map, map.find_field("score")->values, points, at);
    answer.values = values_of(map, answer.map_point);
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
  const Points adaptor{map.positions};
  Tree tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  tree.buildIndex();
  std::vector<LookupAnswer> answers(points.size());
  libmap::parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) answers[n] = answer_of(map, tree, points[n], options);
  });
  return answers;
}

}  // namespace libgtd
