// Heights and gradients of the voxel columns in a rectangle. Private to libgtd/score.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

class ColumnHeights {
 public:
  static constexpr double unknown = -std::numeric_limits<double>::infinity();
  static constexpr int gap_columns = 3;  // number of passes that fill gaps

  // The height of a column is that of its highest voxel. In each of gap_columns passes, a column
  // without voxels gets the mean height of its known neighbors (8-neighborhood).
  ColumnHeights(const VoxelGrid& grid, const TileBounds& bounds);

  // Returns the index of a column inside the bounds.
  std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(i - bounds_.i_begin) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(j - bounds_.j_begin);
  }
  // Returns the difference of the indices of two columns that are i and j columns apart.
  std::ptrdiff_t step(int i, int j) const { return static_cast<std::ptrdiff_t>(i) * width_ + j; }
  std::size_t size() const { return heights_.size(); }
  // Height in m from the origin of the lattice; `unknown` without ground.
  double height(std::size_t at) const { return heights_[at]; }
  // dz/dx and dz/dy; 0 beside columns without ground.
  const std::array<double, 2>& gradient(std::size_t at) const { return gradients_[at]; }

 private:
  void fill_gaps();
  void find_gradients(double voxel_size_m);

  TileBounds bounds_;
  int width_ = 0;
  std::vector<double> heights_;
  std::vector<std::array<double, 2>> gradients_;
};

}  // namespace libgtd
