#include "libgtd/score/column_heights.h"

#include <algorithm>
#include <utility>

#include "libgtd/score/scanned_area.h"

namespace libgtd {

ColumnHeights::ColumnHeights(const VoxelGrid& grid, const TileBounds& bounds)
    : bounds_(bounds), width_(bounds.j_end - bounds.j_begin) {
  const auto size =
      static_cast<std::size_t>(bounds.i_end - bounds.i_begin) * static_cast<std::size_t>(width_);
  heights_.assign(size, unknown);
  // Voxels ascend, so that the highest of a column is last.
  visit_columns(grid, bounds, [&](std::size_t at) {
    const Voxel& voxel = grid.voxels[at];
    heights_[index(voxel.i, voxel.j)] = (voxel.k + 0.5) * grid.lattice.voxel_size_m;
  });
  for (int round = 0; round < gap_columns; ++round) fill_gaps();
  find_gradients(grid.lattice.voxel_size_m);
}

void ColumnHeights::fill_gaps() {
  std::vector<double> filled = heights_;
  const int rows = bounds_.i_end - bounds_.i_begin;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < width_; ++j) {
      const auto at = static_cast<std::size_t>(i) * static_cast<std::size_t>(width_) +
                      static_cast<std::size_t>(j);
      if (heights_[at] != unknown) continue;
      double sum = 0.0;
      int count = 0;
      for (int di = std::max(i - 1, 0); di <= std::min(i + 1, rows - 1); ++di)
        for (int dj = std::max(j - 1, 0); dj <= std::min(j + 1, width_ - 1); ++dj) {
          const double height =
              heights_[static_cast<std::size_t>(di) * static_cast<std::size_t>(width_) +
                       static_cast<std::size_t>(dj)];
          if (height == unknown) continue;
          sum += height;
          ++count;
        }
      if (count > 0) filled[at] = sum / count;
    }
  heights_ = std::move(filled);
}

void ColumnHeights::find_gradients(double voxel_size_m) {
  gradients_.assign(heights_.size(), {0.0, 0.0});
  const auto between = [&](std::size_t low, std::size_t high) {
    if (heights_[low] == unknown || heights_[high] == unknown) return 0.0;
    return (heights_[high] - heights_[low]) / (2.0 * voxel_size_m);
  };
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t at = width + 1; at + width + 1 < heights_.size(); ++at)
    gradients_[at] = {between(at - width, at + width), between(at - 1, at + 1)};
}

}  // namespace libgtd
