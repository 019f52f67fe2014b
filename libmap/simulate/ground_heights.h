// Coarse grid of ground heights, computed from points, for camera paths over terrain and for the
// extent and density of parts of the terrain. Lengths are in meters.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <utility>

namespace libmap {

class GroundHeights {
 public:
  static constexpr double cell_m = 0.5;  // edge length of a cell

  // Adds points, which must be finite. The order of points has no influence.
  void add(std::span<const Eigen::Vector3d> points);

  bool empty() const { return cells_.empty(); }
  const Eigen::AlignedBox2d& box() const { return box_; }  // bounding box in x and y
  // Returns the mean height of the cells within about 1.5 m, weighted by a Gaussian with a standard
  // deviation of cell_m; the mean of all cells if no cell is near, 0 without points.
  double height(const Eigen::Vector2d& position) const;
  // Returns the mean point spacing in the cells that contain points; 0 without points.
  double spacing_m() const;
  // Bounding box of the points of all cells that intersect the rectangle; empty if there are none.
  Eigen::AlignedBox3d extent(const Eigen::AlignedBox2d& rectangle) const;

 private:
  using CellIndex = std::pair<std::int64_t, std::int64_t>;
  struct Cell {
    std::size_t points = 0;
    double sum = 0.0;
    Eigen::AlignedBox3d box;
  };
  static CellIndex index_of(const Eigen::Vector2d& position);

  std::map<CellIndex, Cell> cells_;
  Eigen::AlignedBox2d box_;
};

}  // namespace libmap
