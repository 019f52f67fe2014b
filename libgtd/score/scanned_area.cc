#include "libgtd/score/scanned_area.h"

#include <algorithm>

namespace libgtd {

namespace {

template <typename Visit>
void for_each_column(const TileBounds& bounds, const Visit& visit) {
  for (int i = bounds.i_begin; i < bounds.i_end; ++i)
    for (int j = bounds.j_begin; j < bounds.j_end; ++j) visit(i, j);
}

}  // namespace

ColumnSums::ColumnSums(const TileBounds& bounds)
    : bounds_(bounds),
      width_(static_cast<std::size_t>(bounds.j_end - bounds.j_begin) + 1),
      sums_((static_cast<std::size_t>(bounds.i_end - bounds.i_begin) + 1) * width_) {}

void ColumnSums::accumulate() {
  for (int i = bounds_.i_begin + 1; i <= bounds_.i_end; ++i)
    for (int j = bounds_.j_begin + 1; j <= bounds_.j_end; ++j)
      sums_[at(i, j)] += sums_[at(i - 1, j)] + sums_[at(i, j - 1)] - sums_[at(i - 1, j - 1)];
}

std::uint32_t ColumnSums::count(TileBounds part) const {
  part.i_begin = std::max(part.i_begin, bounds_.i_begin);
  part.j_begin = std::max(part.j_begin, bounds_.j_begin);
  part.i_end = std::min(part.i_end, bounds_.i_end);
  part.j_end = std::min(part.j_end, bounds_.j_end);
  if (part.i_begin >= part.i_end || part.j_begin >= part.j_end) return 0;
  return sums_[at(part.i_end, part.j_end)] - sums_[at(part.i_begin, part.j_end)] -
         sums_[at(part.i_end, part.j_begin)] + sums_[at(part.i_begin, part.j_begin)];
}

TileBounds expanded(const TileBounds& bounds, int below, int above) {
  return {bounds.i_begin - below, bounds.i_end + above, bounds.j_begin - below,
          bounds.j_end + above};
}

TileBounds columns_around(int i, int j, int below, int above) {
  return {i - below, i + above + 1, j - below, j + above + 1};
}

ColumnSums unscanned_columns(const ColumnSums& occupied, const TileBounds& bounds) {
  const int gap = scan_gap_voxels;
  ColumnSums far(expanded(bounds, gap, gap));
  for_each_column(far.bounds(), [&](int i, int j) {
    if (occupied.count(columns_around(i, j, gap, gap)) == 0) far.set(i, j);
  });
  far.accumulate();
  ColumnSums unscanned(bounds);
  for_each_column(bounds, [&](int i, int j) {
    if (far.count(columns_around(i, j, gap, gap)) != 0) unscanned.set(i, j);
  });
  unscanned.accumulate();
  return unscanned;
}

ColumnSums unscanned_columns(const VoxelGrid& grid, const TileBounds& bounds) {
  ColumnSums occupied(expanded(bounds, 2 * scan_gap_voxels, 2 * scan_gap_voxels));
  visit_columns(grid, occupied.bounds(),
                [&](std::size_t at) { occupied.set(grid.voxels[at].i, grid.voxels[at].j); });
  occupied.accumulate();
  return unscanned_columns(occupied, bounds);
}

}  // namespace libgtd
