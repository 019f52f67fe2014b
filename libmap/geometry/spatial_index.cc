#include "libmap/geometry/spatial_index.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <numbers>
#include <tuple>
#include <utility>

#include "libmap/core/median.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

// Adapter of a list of points to nanoflann.
struct PointList {
  const std::vector<Eigen::Vector3d>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t n, std::size_t axis) const {
    return points[n][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointList>,
                                                 PointList, 3, std::size_t>;

// The first nearest point found. The search stops at a distance of 0; otherwise, it would visit all
// points of equal position.
struct NearestPoint {
  NeighborPoint neighbor{0, std::numeric_limits<double>::infinity()};

  bool full() const { return true; }
  double worstDist() const { return neighbor.square_m2; }
  // Returns true to continue the search.
  bool addPoint(double square_m2, std::size_t index) {
    if (square_m2 < neighbor.square_m2) neighbor = {index, square_m2};
    return neighbor.square_m2 > 0.0;
  }
};

// Search radius with a margin, because the tree rounds the distances of its boxes.
double with_margin(double square_m2) {
  constexpr double margin = 1e-9;
  return std::nextafter(square_m2 * (1.0 + margin), HUGE_VAL);
}

// The nearest point with the lowest index. It keeps no list of candidates: from far away, all
// points are at nearly the same distance.
struct FirstOfNearest {
  NeighborPoint neighbor{0, HUGE_VAL};
  double worst = HUGE_VAL;

  bool full() const { return true; }
  double worstDist() const { return worst; }
  bool addPoint(double square_m2, std::size_t index) {
    if (square_m2 < neighbor.square_m2 ||
        (square_m2 == neighbor.square_m2 && index < neighbor.index)) {
      neighbor = {index, square_m2};
      worst = with_margin(square_m2);
    }
    return true;
  }
};

// The `count` nearest points; ties are resolved by the lowest index.
struct FirstOfNearestPoints {
  std::size_t count;
  std::vector<NeighborPoint> neighbors{};  // the nearest first
  double worst = std::numeric_limits<double>::max();

  bool full() const { return neighbors.size() == count; }
  double worstDist() const { return worst; }
  bool addPoint(double square_m2, std::size_t index) {
    const NeighborPoint point{index, square_m2};
    const auto before = [](const NeighborPoint& a, const NeighborPoint& b) {
      return std::tie(a.square_m2, a.index) < std::tie(b.square_m2, b.index);
    };
    if (full() && !before(point, neighbors.back())) return true;
    if (full()) neighbors.pop_back();
    neighbors.insert(std::upper_bound(neighbors.begin(), neighbors.end(), point, before), point);
    if (full()) worst = with_margin(neighbors.back().square_m2);
    return true;
  }
};

}  // namespace

struct PointTree::Index {
  PointList list;
  Tree tree;
  explicit Index(const std::vector<Eigen::Vector3d>& points)
      : list{points}, tree(3, list, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}
};

PointTree::PointTree(const std::vector<Eigen::Vector3d>& points)
    : index_(std::make_unique<Index>(points)) {}
PointTree::~PointTree() = default;
PointTree::PointTree(PointTree&&) noexcept = default;
PointTree& PointTree::operator=(PointTree&&) noexcept = default;

std::vector<NeighborPoint> PointTree::nearest(const Eigen::Vector3d& point,
                                              std::size_t count) const {
  FirstOfNearestPoints result{std::min(count, index_->list.points.size())};
  if (result.count > 0) {
    result.neighbors.reserve(result.count);
    index_->tree.findNeighbors(result, point.data(), nanoflann::SearchParams());
  }
  return std::move(result.neighbors);
}

NeighborPoint PointTree::nearest(const Eigen::Vector3d& point) const {
  NearestPoint result;
  index_->tree.findNeighbors(result, point.data(), nanoflann::SearchParams());
  return result.neighbor;
}

NeighborPoint PointTree::first_of_nearest(const Eigen::Vector3d& point) const {
  FirstOfNearest result;
  index_->tree.findNeighbors(result, point.data(), nanoflann::SearchParams());
  return result.neighbor;
}

std::vector<NeighborPoint> PointTree::around(std::size_t n, std::size_t count,
                                             double radius_m) const {
  std::vector<NeighborPoint> found = nearest(index_->list.points[n], count + 1);
  std::erase_if(found, [&](const NeighborPoint& near) {
    return near.index == n || near.square_m2 > radius_m * radius_m;
  });
  found.resize(std::min(found.size(), count));
  return found;
}

std::vector<NeighborPoint> PointTree::within(const Eigen::Vector3d& point, double radius_m) const {
  std::vector<NeighborPoint> neighbors;
  if (index_->list.points.empty()) return neighbors;
  const double square = radius_m * radius_m;
  std::vector<std::pair<std::size_t, double>> matches;
  index_->tree.radiusSearch(point.data(), with_margin(square), matches, nanoflann::SearchParams());
  std::sort(matches.begin(), matches.end());
  neighbors.reserve(matches.size());
  for (const auto& [index, square_m2] : matches)
    if (square_m2 <= square) neighbors.push_back({index, square_m2});
  return neighbors;
}

namespace {

// Squared distance to the nearest point at another position; 0 if the first 512 points are at this
// position.
double square_to_next(const PointTree& tree, const Eigen::Vector3d& point) {
  constexpr std::size_t max_here = 512;
  for (std::size_t count = 2; count <= max_here; count *= 4)
    for (const NeighborPoint& neighbor : tree.nearest(point, count))
      if (neighbor.square_m2 > 0.0) return neighbor.square_m2;
  return 0.0;
}

}  // namespace

namespace {

constexpr std::size_t area_neighbors = 17;  // the point itself is one
// A nearest neighbor within this share of the spacing by area is a near-duplicate. Random points
// have 0.47, grids 1.
constexpr double min_nearest_fraction = 0.3;
constexpr double merged_fraction = 0.25;

// Spacing of a square grid with as many points per area. The median distance to the 16th neighbor
// is the radius of a disc that contains 16 points.
double area_spacing(const PointTree& tree, const std::vector<Eigen::Vector3d>& points) {
  constexpr std::size_t most = 2000;
  std::vector<double> squares(std::min(points.size(), most));
  const std::size_t count = std::min(area_neighbors, points.size());
  parallel_each(squares.size(), 64, [&](std::size_t n) {
    squares[n] = tree.nearest(points[n * points.size() / squares.size()], count).back().square_m2;
  });
  return std::sqrt(std::numbers::pi * median(std::move(squares)) / static_cast<double>(count - 1));
}

// Returns the points in order, without points closer than `distance_m` to a point kept before.
std::vector<Eigen::Vector3d> merge_near(const std::vector<Eigen::Vector3d>& points,
                                        double distance_m) {
  GrowingGrid grid(points.front(), distance_m, points.size());
  std::vector<Eigen::Vector3d> kept;
  for (const Eigen::Vector3d& point : points) {
    if (grid.any_nearer(point, distance_m, distance_m * distance_m)) continue;
    grid.add(point);
    kept.push_back(point);
  }
  return kept;
}

}  // namespace

CloudSpacing point_spacing(const std::vector<Eigen::Vector3d>& points) {
  constexpr std::size_t most = 10000;
  if (points.size() < 2) return {};
  const PointTree tree(points);
  std::vector<double> squares(std::min(points.size(), most));
  parallel_each(squares.size(), 256, [&](std::size_t n) {
    const std::size_t index = n * points.size() / squares.size();
    squares[n] = square_to_next(tree, points[index]);
  });
  std::erase(squares, 0.0);
  if (squares.empty()) return {};
  CloudSpacing spacing{std::sqrt(median(std::move(squares))), area_spacing(tree, points)};
  if (spacing.nearest_m >= min_nearest_fraction * spacing.by_area_m) return spacing;
  const std::vector<Eigen::Vector3d> merged =
      merge_near(points, merged_fraction * spacing.by_area_m);
  if (merged.size() > area_neighbors) spacing.nearest_m = area_spacing(PointTree(merged), merged);
  return spacing;
}

double median_spacing(const std::vector<Eigen::Vector3d>& points) {
  return point_spacing(points).nearest_m;
}

}  // namespace libmap
