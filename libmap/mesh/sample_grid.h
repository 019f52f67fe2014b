// Points that come one by one, in a hashed grid of cubes: PointTree needs all of its points before
// the first search, and nanoflann's tree that grows takes 10 times as long for 74,000 samples.
// Inner part of libmap/mesh.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libmap {

// Cells share slots where their hashes meet, so that a search may see points that lie elsewhere:
// who searches measures distances anyway. Positions are counted from `origin`.
class SampleGrid {
 public:
  // Quickest for boxes of about `cell_m`.
  SampleGrid(const Eigen::Vector3d& origin, double cell_m, std::size_t expected_points)
      : origin_(origin), cells_per_m_(1.0 / cell_m) {
    std::size_t slots = 64;
    while (slots < 2 * expected_points) slots *= 2;
    heads_.assign(slots, none);
    nodes_.reserve(expected_points);
  }

  std::size_t size() const { return nodes_.size(); }
  const Eigen::Vector3d& operator[](std::size_t index) const { return nodes_[index].position; }

  void add(const Eigen::Vector3d& position) {
    if (2 * nodes_.size() >= heads_.size()) {
      heads_.assign(2 * heads_.size(), none);
      for (std::uint32_t n = 0; n < nodes_.size(); ++n) link(n);
    }
    nodes_.push_back({position, none});
    link(static_cast<std::uint32_t>(nodes_.size() - 1));
  }

  // visit(position, index) of each point in the box, and of others; true ends the search. Returns
  // whether one did.
  template <typename Visit>
  bool any_in_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                  const Visit& visit) const {
    const Cell first = cell_of(low);
    const Cell last = cell_of(high);
    for (std::int64_t z = first.z; z <= last.z; ++z)
      for (std::int64_t y = first.y; y <= last.y; ++y)
        for (std::int64_t x = first.x; x <= last.x; ++x)
          for (std::uint32_t n = heads_[slot({x, y, z})]; n != none; n = nodes_[n].next)
            if (visit(nodes_[n].position, n)) return true;
    return false;
  }

  // Whether a point is closer to `place` than the root of `square_m2`, which is `radius_m`.
  bool any_nearer(const Eigen::Vector3d& place, double radius_m, double square_m2) const {
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius_m);
    return any_in_box(place - reach, place + reach,
                      [&](const Eigen::Vector3d& point, std::uint32_t) {
                        return (point - place).squaredNorm() < square_m2;
                      });
  }

 private:
  static constexpr std::uint32_t none = 0xffffffff;
  struct Node {
    Eigen::Vector3d position;
    std::uint32_t next;
  };
  struct Cell {
    std::int64_t x, y, z;
  };

  Cell cell_of(const Eigen::Vector3d& position) const {
    constexpr double farthest = 1e18;  // that whole numbers hold
    const Eigen::Vector3d at =
        ((position - origin_) * cells_per_m_).cwiseMin(farthest).cwiseMax(-farthest);
    return {static_cast<std::int64_t>(std::floor(at.x())),
            static_cast<std::int64_t>(std::floor(at.y())),
            static_cast<std::int64_t>(std::floor(at.z()))};
  }
  // Neighbors along x lie side by side.
  std::size_t slot(const Cell& cell) const {
    return (static_cast<std::uint64_t>(cell.x) + 73856093U * static_cast<std::uint64_t>(cell.y) +
            19349663U * static_cast<std::uint64_t>(cell.z)) &
           (heads_.size() - 1);
  }
  void link(std::uint32_t n) {
    std::uint32_t& head = heads_[slot(cell_of(nodes_[n].position))];
    nodes_[n].next = head;
    head = n;
  }

  Eigen::Vector3d origin_;
  double cells_per_m_;
  std::vector<std::uint32_t> heads_;
  std::vector<Node> nodes_;
};

}  // namespace libmap
