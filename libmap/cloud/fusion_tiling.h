// Squares of the x-y plane in which fusion makes its cloud, one after the other. Inner part of
// depth_fusion.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "libmap/cloud/plan_cells.h"
#include "libmap/core/plan_tiles.h"

namespace libmap {

// Voxels around an element that have a say in whether and where it is.
inline constexpr int element_neighborhood = 3;

// Squares of whole voxels in the x-y plane of the world, and what their points depend on.
class FusionTiling {
 public:
  using Cell = Eigen::Array<std::int64_t, 2, 1>;
  // Tiles of about `tile_m`; the grid has its origin at `grid_origin` of the world. A point may
  // have moved by `shift_m` from where its element was, and what a frame measured counts `disc_m`
  // around.
  FusionTiling(double tile_m, double voxel_m, const Eigen::Vector3d& grid_origin, double shift_m,
               double disc_m);

  // use(tile) for each tile to which a frame of this reach in the grid, m, matters.
  template <typename Use>
  void each_tile(const Eigen::AlignedBox3d& reach, const Use& use) const {
    const auto tile_of = [&](const Eigen::Vector3d& place, int margin) -> Cell {
      const Cell cell =
          (place.head<2>() / voxel_m_).array().floor().cast<std::int64_t>() + origin_ + margin;
      return {floor_of_ratio(cell.x()), floor_of_ratio(cell.y())};
    };
    const Cell first = tile_of(reach.min(), -frame_margin_);
    const Cell last = tile_of(reach.max(), frame_margin_);
    for (std::int64_t i = first.x(); i <= last.x(); ++i)
      for (std::int64_t j = first.y(); j <= last.y(); ++j) use(PlanTile{i, j});
  }

  // The cells of the grid whose points are in the tile.
  PlanCells points(const PlanTile& tile) const;
  // Voxels around a tile whose elements its points depend on.
  int element_margin() const { return element_margin_; }

 private:
  std::int64_t floor_of_ratio(std::int64_t cell) const;

  double voxel_m_;
  std::int64_t side_;
  Cell origin_;
  int element_margin_;
  int frame_margin_;
};

}  // namespace libmap
