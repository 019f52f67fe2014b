// The project's neighbor search among points that are all known (a k-d tree by nanoflann). Other
// structures exist where this one cannot be used; each says why: libmap/mesh/sample_grid.h,
// libmap/cloud/surface_normals.cc, libgtd/shape/point_grid.h.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

namespace libmap {

struct NeighborPoint {
  std::size_t index = 0;
  double square_m2 = 0.0;  // of the distance
};

class PointTree {
 public:
  // The points, all finite, must stay while the tree lives.
  explicit PointTree(const std::vector<Eigen::Vector3d>& points);
  ~PointTree();
  PointTree(PointTree&&) noexcept;
  PointTree& operator=(PointTree&&) noexcept;

  // The `count` nearest points, or all if there are fewer, the nearest first, of equally near ones
  // those of the lowest index. May be called from several threads at once.
  std::vector<NeighborPoint> nearest(const Eigen::Vector3d& point, std::size_t count) const;
  // The nearest one; there must be one.
  NeighborPoint nearest(const Eigen::Vector3d& point) const;
  // The nearest one, among equally near ones that of the lowest index; there must be one.
  NeighborPoint first_of_nearest(const Eigen::Vector3d& point) const;
  // The `count` points nearest to the n-th and at most `radius_m` away, the nearest first, without
  // the n-th.
  std::vector<NeighborPoint> around(std::size_t n, std::size_t count, double radius_m) const;
  // All points at most `radius_m` away, by index.
  std::vector<NeighborPoint> within(const Eigen::Vector3d& point, double radius_m) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

// Median of the distances from points to the nearest elsewhere, m; of at most 10000 of them, spread
// evenly over the list. 0 if there are no two places.
double median_spacing(const std::vector<Eigen::Vector3d>& points);

}  // namespace libmap
