// Divides the x-y plane into tiles for fusion, each with the margin of voxels that affects the
// tile's points. Private to depth_fusion.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libmap/fusion/surface_points.h"
#include "libmap/fusion/tile_mask.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

// Distance in voxels within which other voxels affect a SurfaceElement, the source of a point.
inline constexpr int element_neighborhood = 3;

// Tiles of whole voxels in the x-y plane of the world, with the margins that affect points.
class FusionTiling {
 public:
  using Cell = Eigen::Array<std::int64_t, 2, 1>;
  // `tile_m` is the side of a tile, `grid_origin` the grid's origin in the world. Points are up to
  // `shift_m` from their elements, and measurements affect elements within `disc_m`.
  FusionTiling(double tile_m, double voxel_m, const Eigen::Vector3d& grid_origin, double shift_m,
               double disc_m)
      : voxel_m_(voxel_m),
        side_(std::max<std::int64_t>(1, std::llround(tile_m / voxel_m))),
        origin_((grid_origin.head<2>() / voxel_m).array().round().cast<std::int64_t>()),
        element_margin_(static_cast<int>(std::ceil(shift_m / voxel_m)) + point_neighborhood +
                        2 * contradiction_block),
        frame_margin_(element_margin_ + element_neighborhood + 1 +
                      static_cast<int>(std::ceil((shift_m + disc_m) / voxel_m))) {}

  // Calls use(tile) for each tile that a frame with the box `reach` (m, grid frame) affects.
  template <typename Use>
  void each_tile(const Eigen::AlignedBox3d& reach, const Use& use) const {
    const auto tile_of = [&](const Eigen::Vector3d& position, int margin) -> Cell {
      const Cell cell =
          (position.head<2>() / voxel_m_).array().floor().cast<std::int64_t>() + origin_ + margin;
      return {floor_of_ratio(cell.x()), floor_of_ratio(cell.y())};
    };
    const Cell first = tile_of(reach.min(), -frame_margin_);
    const Cell last = tile_of(reach.max(), frame_margin_);
    for (std::int64_t i = first.x(); i <= last.x(); ++i)
      for (std::int64_t j = first.y(); j <= last.y(); ++j) use(XyTile{i, j});
  }

  // Returns the columns of the grid with points in the tile.
  TileMask points(const XyTile& tile) const {
    const Cell low = Cell(tile.i, tile.j) * side_ - origin_;
    constexpr std::int64_t limit = voxel_cell_limit;
    return {low.max(-limit).min(limit).cast<int>(),
            (low + side_).max(-limit).min(limit).cast<int>(), 0};
  }
  // Width in voxels of the margin around a tile. Elements in the margin affect the tile's points.
  int element_margin() const { return element_margin_; }

 private:
  // Distance in voxels within which other points affect a point's normal and removal.
  static constexpr int point_neighborhood = 4;

  std::int64_t floor_of_ratio(std::int64_t cell) const {
    return cell >= 0 ? cell / side_ : -((side_ - 1 - cell) / side_);
  }

  double voxel_m_;
  std::int64_t side_;
  Cell origin_;
  int element_margin_;
  int frame_margin_;
};

}  // namespace libmap
