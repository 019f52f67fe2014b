// Which tiles' points a run of `graspmap score` into a tile store reads.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "libgtd/score/scanned_area.h"
#include "libgtd/score/tile_store.h"

namespace graspmap_tools {

// The tiles on whose points some of the wanted ones depend: those up to `reach` tiles from one.
// `first` and `last` are corners of a rectangle that holds the wanted ones.
class NeededTiles {
 public:
  NeededTiles(const libgtd::TileNumber& first, const libgtd::TileNumber& last, int reach,
              const std::vector<libgtd::TileNumber>& wanted)
      : reach_(reach), wanted_({first.i, last.i + 1, first.j, last.j + 1}) {
    for (const libgtd::TileNumber& tile : wanted) wanted_.set(tile.i, tile.j);
    wanted_.accumulate();
  }

  bool hold(const libgtd::TileNumber& tile) const { return hold_any(tile, tile); }
  // Of the rectangle from `first` to `last`.
  bool hold_any(const libgtd::TileNumber& first, const libgtd::TileNumber& last) const {
    return wanted_.count(
               {first.i - reach_, last.i + reach_ + 1, first.j - reach_, last.j + reach_ + 1}) != 0;
  }

 private:
  int reach_;
  libgtd::ColumnSums wanted_;
};

// The tile of a place, which may lie anywhere: boxes are read from a file.
inline libgtd::TileNumber tile_near(const libgtd::VoxelLattice& lattice,
                                    const Eigen::Vector3d& place_in_terrain, int tile_voxels) {
  const auto index = [](double cell) {
    constexpr double farthest = 0x1p29;
    return cell >= -farthest ? static_cast<int>(std::floor(std::min(cell, farthest)))
                             : -static_cast<int>(farthest);
  };
  const Eigen::Vector3d cell = lattice.cell_of(place_in_terrain);
  return libgtd::tile_of({index(cell.x()), index(cell.y()), 0}, tile_voxels);
}

}  // namespace graspmap_tools
