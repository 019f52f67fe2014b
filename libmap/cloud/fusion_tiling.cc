#include "libmap/cloud/fusion_tiling.h"

#include <algorithm>
#include <cmath>

#include "libmap/cloud/surface_points.h"

namespace libmap {

namespace {

// Voxels around a point whose points have a say in its normal, and in whether it is an echo.
constexpr int point_neighborhood = 4;

}  // namespace

FusionTiling::FusionTiling(double tile_m, double voxel_m, const Eigen::Vector3d& grid_origin,
                           double shift_m, double disc_m)
    : voxel_m_(voxel_m),
      side_(std::max<std::int64_t>(1, std::llround(tile_m / voxel_m))),
      origin_((grid_origin.head<2>() / voxel_m).array().round().cast<std::int64_t>()),
      element_margin_(static_cast<int>(std::ceil(shift_m / voxel_m)) + point_neighborhood +
                      2 * contradiction_block),
      frame_margin_(element_margin_ + element_neighborhood + 1 +
                    static_cast<int>(std::ceil((shift_m + disc_m) / voxel_m))) {}

PlanCells FusionTiling::points(const PlanTile& tile) const {
  const Cell low = Cell(tile.i, tile.j) * side_ - origin_;
  constexpr std::int64_t limit = voxel_cell_limit;
  return {low.max(-limit).min(limit).cast<int>(), (low + side_).max(-limit).min(limit).cast<int>(),
          0};
}

std::int64_t FusionTiling::floor_of_ratio(std::int64_t cell) const {
  return cell >= 0 ? cell / side_ : -((side_ - 1 - cell) / side_);
}

}  // namespace libmap
