// Points sorted into cubic cells: whoever asks for all points near a place walks few cells and
// always meets them in the same order, so that sums over neighbours are the same to the bit.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace libgtd {

class PointGrid {
 public:
  using Cell = std::array<std::int64_t, 3>;

  // Points that are not finite are left out. Throws Error where `cell_size_m` is not a positive
  // length, or so small that the points span more than 2^40 cells.
  PointGrid(const std::vector<Eigen::Vector3d>& points, double cell_size_m);

  // Whether a place is finite and at most one cell away from the box around the points.
  bool reaches(const Eigen::Vector3d& place) const;
  // The cell of a place that the grid reaches.
  Cell cell_of(const Eigen::Vector3d& place) const;

  // The points' indices sorted by cell, and by index within one; a cell's are first..last - 1.
  const std::vector<std::uint32_t>& order() const { return order_; }
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t last = 0;
  };
  Range range_of(const Cell& cell) const;
  // Those that hold points, in the order of order().
  const std::vector<Cell>& cells() const { return cells_; }
  const std::vector<Range>& ranges() const { return ranges_; }

 private:
  struct Hash {
    std::size_t operator()(const Cell& cell) const;
  };

  Eigen::Vector3d origin_;  // the box's corners
  Eigen::Vector3d far_;
  double cell_size_m_;
  std::vector<std::uint32_t> order_;
  std::vector<Cell> cells_;
  std::vector<Range> ranges_;
  std::unordered_map<Cell, Range, Hash> range_of_;
};

}  // namespace libgtd
