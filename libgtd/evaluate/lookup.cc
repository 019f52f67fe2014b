#include "libgtd/evaluate/lookup.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <tuple>
#include <utility>

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

// The tree rounds the distances of its boxes: it is asked for a little more.
double with_margin(double squared) {
  constexpr double margin = 1e-9;
  return std::nextafter(squared * (1.0 + margin), HUGE_VAL);
}

// Of the nearest points the first. It keeps no list: from far off all of them are nearly as near.
struct FirstOfNearest {
  std::size_t index = 0;
  double squared = HUGE_VAL;

  bool addPoint(double distance, std::size_t n) {  // NOLINT: nanoflann's names from here on
    if (distance < squared || (distance == squared && n < index))
      std::tie(index, squared) = std::pair(n, distance);
    return true;
  }
  double worstDist() const { return with_margin(squared); }
  bool full() const { return true; }
};

// The points with a squared distance of at most `squared`, by index, so that a mean does not depend
// on the tree's order.
std::vector<std::pair<std::size_t, double>> points_within(const Tree& tree,
                                                          const Eigen::Vector3d& point,
                                                          double squared) {
  std::vector<std::pair<std::size_t, double>> matches;
  tree.radiusSearch(point.data(), with_margin(squared), matches, nanoflann::SearchParams());
  std::erase_if(matches, [&](const auto& match) { return match.second > squared; });
  std::sort(matches.begin(), matches.end());
  return matches;
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
  FirstOfNearest nearest;
  tree.findNeighbors(nearest, at.data(), nanoflann::SearchParams());
  answer.map_point = nearest.index;
  answer.distance_m = std::sqrt(nearest.squared);
  if (options.mode == LookupMode::nearest) {
    answer.found = answer.distance_m <= options.max_distance_m;
    if (!answer.found) return answer;
    answer.map_points = 1;
    answer.values = values_of(map, answer.map_point);
    return answer;
  }
  std::vector<std::size_t> points;
  for (const auto& [index, distance] : points_within(tree, at, options.radius_m * options.radius_m))
    points.push_back(index);
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
