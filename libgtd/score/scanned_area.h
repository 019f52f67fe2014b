// Which columns of voxels were scanned: those with voxels, closed over the gaps that a cloud has
// between its points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

// Gaps of up to twice this are closed.
inline constexpr int scan_gap_voxels = 3;

// Columns as a summed-area table (Crow 1984): how many columns of a rectangle are set.
class ColumnSums {
 public:
  explicit ColumnSums(const TileBounds& bounds);  // no column is set

  const TileBounds& bounds() const { return bounds_; }
  void set(int i, int j) { sums_[at(i + 1, j + 1)] = 1; }
  // After the last set().
  void accumulate();
  // Of the rectangle, cut to the table.
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

// The rectangle with `below` columns more at its low sides and `above` at its high ones.
TileBounds grown(const TileBounds& bounds, int below, int above);
// The columns from i - below to i + above, and the same of j.
TileBounds columns_around(int i, int j, int below, int above);

// The columns of `bounds` that are not in the closing (morphological, by a square of
// scan_gap_voxels to each side) of the occupied ones, which are known twice that far beyond.
ColumnSums unscanned_columns(const ColumnSums& occupied, const TileBounds& bounds);
ColumnSums unscanned_columns(const VoxelGrid& grid, const TileBounds& bounds);

}  // namespace libgtd
