// Finds the scanned area of a voxel grid: the occupied voxel columns, closed over the gaps between
// points. Voxels are at the border of the map if their mask window is partly outside this area.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

// Half of the maximum width of gaps that are closed.
inline constexpr int scan_gap_voxels = 3;

// Set of columns as a summed-area table (Crow 1984), which counts the set columns in a rectangle.
class ColumnSums {
 public:
  explicit ColumnSums(const TileBounds& bounds);  // no column is set

  const TileBounds& bounds() const { return bounds_; }
  void set(int i, int j) { sums_[at(i + 1, j + 1)] = 1; }
  // Builds the table. Must be called once, after the last set() and before count().
  void accumulate();
  // Returns the number of set columns in the rectangle, clipped to the table.
  std::uint32_t count(TileBounds part) const;

 private:
  std::size_t at(int i, int j) const {
    return static_cast<std::size_t>(i - bounds_.i_begin) * width_ +
           static_cast<std::size_t>(j - bounds_.j_begin);
  }

  TileBounds bounds_;
  std::size_t width_;
  std::vector<std::uint32_t> sums_;
};

// Returns the rectangle extended by `below` columns at the low sides and `above` at the high sides.
TileBounds expanded(const TileBounds& bounds, int below, int above);
// Returns the columns from i - below to i + above, and the same range around j.
TileBounds columns_around(int i, int j, int below, int above);

// Returns the columns of `bounds` that are not in the morphological closing (by a square of
// scan_gap_voxels to each side) of the occupied columns. `occupied` must extend 2 * scan_gap_voxels
// beyond `bounds`.
ColumnSums unscanned_columns(const ColumnSums& occupied, const TileBounds& bounds);
ColumnSums unscanned_columns(const VoxelGrid& grid, const TileBounds& bounds);

}  // namespace libgtd
