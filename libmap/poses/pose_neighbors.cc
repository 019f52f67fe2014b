#include "libmap/poses/pose_neighbors.h"

#include <cmath>
#include <nanoflann.hpp>

namespace libmap {

namespace {

struct Places {
  std::vector<Eigen::Vector3d> points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t n, std::size_t axis) const {
    return points[n][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Places>,
                                                 Places, 3, std::size_t>;

}  // namespace

struct PoseNeighbors::Parts {
  explicit Parts(std::vector<Eigen::Vector3d> points)
      : places{std::move(points)}, tree(3, places, nanoflann::KDTreeSingleIndexAdaptorParams(10)) {}
  Places places;
  Tree tree;
};

PoseNeighbors::PoseNeighbors(std::vector<Eigen::Vector3d> places)
    : parts_(std::make_unique<Parts>(std::move(places))) {}

PoseNeighbors::~PoseNeighbors() = default;

std::vector<std::pair<std::size_t, double>> PoseNeighbors::nearest(std::size_t n, std::size_t count,
                                                                   double radius_m) const {
  std::vector<std::size_t> numbers(count + 1);
  std::vector<double> squares(count + 1);
  const std::size_t found = parts_->tree.knnSearch(parts_->places.points[n].data(), count + 1,
                                                   numbers.data(), squares.data());
  std::vector<std::pair<std::size_t, double>> result;
  for (std::size_t k = 0; k < found; ++k)
    if (numbers[k] != n && squares[k] <= radius_m * radius_m && result.size() < count)
      result.emplace_back(numbers[k], std::sqrt(squares[k]));
  return result;
}

}  // namespace libmap
