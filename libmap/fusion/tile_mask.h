// Selects columns of voxels by position in the x-y plane. Private to depth_fusion.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/random_stream.h"
#include "libmap/fusion/surface_voxels.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

struct TileMask {
  Eigen::Array2i low = Eigen::Array2i::Constant(-voxel_cell_limit);  // first column
  Eigen::Array2i high = Eigen::Array2i::Constant(voxel_cell_limit);  // last column + 1
  // Selects one in 2^level random blocks of 4 x 4 columns; a larger level selects a subset.
  unsigned subsampling_level = 0;

  // Returns true if the column is selected.
  bool has_cell(const Eigen::Array2i& cell) const {
    if (!((cell >= low).all() && (cell < high).all())) return false;
    if (subsampling_level == 0) return true;
    const auto square = [&](int axis) { return static_cast<std::uint64_t>(cell[axis] >> 2); };
    return mix_bits(square(0), square(1)) >> (64U - subsampling_level) == 0;
  }
  // Returns true in one of ten blocks of 4 x 4 columns, which validate a registration and are not
  // used by it. The position is in voxels.
  static bool is_held_out(const Eigen::Vector2f& position) {
    const Eigen::Array2i square = (position.array() / 4.0F).floor().cast<int>();
    return mix_bits(~static_cast<std::uint64_t>(square.x()),
                    static_cast<std::uint64_t>(square.y())) %
               10 ==
           0;
  }
  // Returns true if the position, in voxels, is in a selected column.
  bool contains(const Eigen::Vector2f& position) const {
    return (position.array().abs() < static_cast<float>(voxel_cell_limit)).all() &&
           has_cell(position.array().floor().cast<int>());
  }

  // Returns the mask with a margin of `cells` columns.
  TileMask grown(int cells) const { return {low - cells, high + cells, subsampling_level}; }
};

}  // namespace libmap
