// Heights of ground that is given by points, in a coarse grid over the plan: where someone who
// walks over it goes, and how much of it lies where.
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
  static constexpr double cell_m = 0.5;

  // Points, finite, in any order.
  void add(std::span<const Eigen::Vector3d> points);

  bool empty() const { return cells_.empty(); }
  const Eigen::AlignedBox2d& box() const { return box_; }
  // Mean height of the cells about the place, weighted by a Gaussian of cell_m; far from all points
  // the mean of all cells. 0 without points.
  double height(const Eigen::Vector2d& place) const;
  // Between points, as if they were a grid over the cells that have any; 0 without points.
  double spacing_m() const;
  // Of the points of the cells that meet the rectangle: empty where there is none.
  Eigen::AlignedBox3d extent(const Eigen::AlignedBox2d& rectangle) const;

 private:
  using Place = std::pair<std::int64_t, std::int64_t>;
  struct Cell {
    std::size_t points = 0;
    double sum = 0.0;
    Eigen::AlignedBox3d box;
  };
  static Place place_of(const Eigen::Vector2d& place);

  std::map<Place, Cell> cells_;
  Eigen::AlignedBox2d box_;
};

}  // namespace libmap
