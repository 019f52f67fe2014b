// Neighbor search among points: PointTree for a fixed set of points, GrowingGrid for points added
// between searches. The README of this folder lists the other search structures with their reasons.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace libmap {

struct NeighborPoint {
  std::size_t index = 0;   // index in the list of points
  double square_m2 = 0.0;  // squared distance, m2
};

// k-d tree by nanoflann. All functions are thread-safe.
class PointTree {
 public:
  // The points must be finite and outlive the tree.
  explicit PointTree(const std::vector<Eigen::Vector3d>& points);
  ~PointTree();
  PointTree(PointTree&&) noexcept;
  PointTree& operator=(PointTree&&) noexcept;

  // Returns the `count` nearest points by ascending distance, or all if there are fewer. Among
  // equal distances, the lowest index is first.
  std::vector<NeighborPoint> nearest(const Eigen::Vector3d& point, std::size_t count) const;
  // Returns the nearest point, any of several at equal distance. The tree must not be empty.
  NeighborPoint nearest(const Eigen::Vector3d& point) const;
  // Like nearest(point), with the lowest index at equal distance. The tree must not be empty.
  NeighborPoint first_of_nearest(const Eigen::Vector3d& point) const;
  // Returns the points nearest to point n within `radius_m`, at most `count` and without point n,
  // by ascending distance.
  std::vector<NeighborPoint> around(std::size_t n, std::size_t count, double radius_m) const;
  // Returns all points within `radius_m` by ascending index.
  std::vector<NeighborPoint> within(const Eigen::Vector3d& point, double radius_m) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

// Returns point_spacing(points).nearest_m, the spacing for most uses.
double median_spacing(const std::vector<Eigen::Vector3d>& points);

struct CloudSpacing {
  // Median distance from a point to the nearest point at another position. If most points are
  // near-duplicates (multiple returns, joined clouds), nearest_m is by_area_m after merging these.
  double nearest_m = 0.0;
  double by_area_m = 0.0;  // spacing of a square grid with the cloud's number of points per area
};
// Returns both spacings from at most 10000 points, spread evenly over the list; 0 if all positions
// are equal.
CloudSpacing point_spacing(const std::vector<Eigen::Vector3d>& points);

// Points in a hashed grid of cubes that starts at `origin`. nanoflann's dynamic tree takes 10 times
// as long for 74,000 samples. Cells with equal hashes share a slot, so any_in_box() can also visit
// points outside the box, which the caller must exclude.
class GrowingGrid {
 public:
  // Searches are fastest in boxes with sides of about `cell_m`.
  GrowingGrid(const Eigen::Vector3d& origin, double cell_m, std::size_t expected_points)
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

  // Calls visit(position, index) for each point in the box, and for some others, until `visit`
  // returns true. Returns true if `visit` did.
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

  // True if a point's squared distance to `position` is below `square_m2`, which is radius_m^2.
  bool any_nearer(const Eigen::Vector3d& position, double radius_m, double square_m2) const {
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius_m);
    return any_in_box(position - reach, position + reach,
                      [&](const Eigen::Vector3d& point, std::uint32_t) {
                        return (point - position).squaredNorm() < square_m2;
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
    constexpr double farthest = 1e18;  // within the range of std::int64_t
    const Eigen::Vector3d at =
        ((position - origin_) * cells_per_m_).cwiseMin(farthest).cwiseMax(-farthest);
    return {static_cast<std::int64_t>(std::floor(at.x())),
            static_cast<std::int64_t>(std::floor(at.y())),
            static_cast<std::int64_t>(std::floor(at.z()))};
  }
  // Neighbors along x are adjacent in memory.
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
