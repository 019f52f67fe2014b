// Computes the counts of match_voxels by the plain triple loop of listing A.6, over a dense array
// of the whole box, single-threaded. Oracle of the tests and baseline of the benchmarks.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/score/voxel_matching.h"

namespace graspmap_test {

inline std::vector<libgtd::VoxelCounts> match_voxels_plainly(
    const libgtd::VoxelGrid& grid, const libgtd::GripperMask& mask,
    const std::vector<std::size_t>& pivots) {
  const int nx = grid.max.i - grid.min.i + 1;
  const int ny = grid.max.j - grid.min.j + 1;
  const int nz = grid.max.k - grid.min.k + 1;
  std::vector<int> dense(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny) *
                         static_cast<std::size_t>(nz));
  const auto cell = [&](int i, int j, int k) -> int* {
    if (i < 0 || i >= nx || j < 0 || j >= ny || k < 0 || k >= nz) return nullptr;
    return &dense[(static_cast<std::size_t>(i) * static_cast<std::size_t>(ny) +
                   static_cast<std::size_t>(j)) *
                      static_cast<std::size_t>(nz) +
                  static_cast<std::size_t>(k)];
  };
  for (const libgtd::Voxel& voxel : grid.voxels)
    *cell(voxel.i - grid.min.i, voxel.j - grid.min.j, voxel.k - grid.min.k) = 1;
  std::vector<libgtd::VoxelCounts> counts;
  for (const std::size_t at : pivots) {
    const libgtd::Voxel& pivot = grid.voxels[at];
    libgtd::VoxelCounts& count = counts.emplace_back();
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y)
        for (int z = 0; z < mask.layers; ++z) {
          const int* occupied = cell(pivot.i - grid.min.i - mask.pivot_xy + x,
                                     pivot.j - grid.min.j - mask.pivot_xy + y,
                                     pivot.k - grid.min.k - mask.pivot_z + z);
          if (occupied == nullptr || *occupied == 0 || !mask.is_counted(x, y, z)) continue;
          count.ssv += 1;
          if (mask.is_solid(x, y, z)) count.gsv += 1;
        }
  }
  return counts;
}

}  // namespace graspmap_test
