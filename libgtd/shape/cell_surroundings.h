// The points around one cell of a grid after the other, gathered once for all places in the cell.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/shape/neighbor_loops.h"
#include "libgtd/shape/point_grid.h"

namespace libgtd {

// Coordinates one axis after the other, with room for a full set of lanes beyond the last.
class CoordinateRows {
 public:
  // Keeps no values.
  void make_room(std::size_t count);
  NeighborLoops::Places places() {
    return {values_.data(), values_.data() + stride_, values_.data() + 2 * stride_};
  }

 private:
  std::size_t stride_ = 0;
  std::vector<double> values_;
};

// The points of a grid in its order, as what reads them cell after cell wants them.
std::vector<Eigen::Vector3d> in_order_of(const PointGrid& grid,
                                         const std::vector<Eigen::Vector3d>& points);

// Of `count` neighbors, in the unit of their coordinates.
Eigen::Matrix3d covariance_of(const NeighborLoops& loops, const NeighborLoops::Places& neighbors,
                              std::size_t count);

class CellSurroundings {
 public:
  // `in_order` are the grid's points in its order, in any frame and unit; both outlive this.
  CellSurroundings(const PointGrid& grid, const std::vector<Eigen::Vector3d>& in_order)
      : grid_(grid), in_order_(in_order) {}

  // Gathers the points of all cells at most `reach` away along each axis, in the grid's order;
  // infinite ones follow up to a full set of lanes.
  void enter(const PointGrid::Cell& cell, std::int64_t reach);
  NeighborLoops::Places places() { return rows_.places(); }
  std::size_t count() const { return count_; }
  // Where in them a run of one column of cells ends and the next one begins.
  const std::vector<std::size_t>& run_ends() const { return run_ends_; }

 private:
  const PointGrid& grid_;
  const std::vector<Eigen::Vector3d>& in_order_;
  std::vector<PointGrid::Range> runs_;
  std::vector<std::size_t> run_ends_;
  CoordinateRows rows_;
  std::size_t count_ = 0;
};

}  // namespace libgtd
