// The terrain as a sparse set of occupied voxels.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

struct VoxelGrid {
  VoxelLattice lattice;
  std::vector<Voxel> voxels;  // occupied, ascending, each once
  Voxel min;                  // of the box of the grid; may be larger than that of the voxels
  Voxel max;
};

// A rectangle of voxel columns, [begin, end) in i and j.
struct TileBounds {
  int i_begin = 0;
  int i_end = 0;
  int j_begin = 0;
  int j_end = 0;
};

// The first of `at` .. `end` that is not below `voxel`, in steps that double: near `at` it takes
// few.
template <typename Iterator>
Iterator first_not_below(Iterator at, Iterator end, const Voxel& voxel) {
  auto step = typename std::iterator_traits<Iterator>::difference_type{1};
  while (step < end - at && *(at + step) < voxel) {
    at += step;
    step *= 2;
  }
  return std::lower_bound(at, step < end - at ? at + step : end, voxel);
}

// Calls visit(n, m) for each two of the ascending voxels, n < m, at most `reach` apart along each
// axis.
template <typename Visit>
void visit_pairs(const std::vector<Voxel>& voxels, int reach, const Visit& visit) {
  // In each of the rows i .. i + reach the first voxel of the columns j - reach .. j + reach: it
  // moves on as the voxels do.
  std::vector<std::vector<Voxel>::const_iterator> firsts(static_cast<std::size_t>(reach) + 1,
                                                         voxels.begin());
  constexpr int lowest = std::numeric_limits<int>::min();
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Voxel& voxel = voxels[n];
    for (int di = 0; di <= reach; ++di) {
      auto& first = firsts[static_cast<std::size_t>(di)];
      first = first_not_below(first, voxels.end(), {voxel.i + di, voxel.j - reach, lowest});
      for (auto at = first; at != voxels.end() && at->i == voxel.i + di && at->j <= voxel.j + reach;
           ++at) {
        const auto m = static_cast<std::size_t>(at - voxels.begin());
        if (m > n && std::abs(at->k - voxel.k) <= reach) visit(n, m);
      }
    }
  }
}

// Number of voxels without an occupied one among their 26 neighbors.
std::size_t count_lone(const std::vector<Voxel>& voxels);

// Throws Error naming the spacing of the points if more than 60 % of the voxels are lone: such
// points are not a surface at this voxel size. A regular grid of more than two voxels' spacing has
// 100 %, one of 1.5 voxels less than half; of the published pre-scanned cloud of scenario 2, 54 %
// are lone at the voxel size that it was published for, and it must not be refused.
void require_dense(std::size_t lone, std::size_t voxels, double voxel_size_m,
                   const std::vector<Eigen::Vector3d>& points);

// Calls visit(first, last) for each row of voxels of one i in the columns, ascending: positions
// first .. last - 1 in grid.voxels.
template <typename Visit>
void visit_rows(const VoxelGrid& grid, const TileBounds& columns, const Visit& visit) {
  const auto begin = grid.voxels.begin();
  const auto end = grid.voxels.end();
  constexpr int lowest = std::numeric_limits<int>::min();
  auto at = std::lower_bound(begin, end, Voxel{columns.i_begin, columns.j_begin, lowest});
  while (at != end && at->i < columns.i_end) {
    const int i = at->i;
    const auto first = first_not_below(at, end, {i, columns.j_begin, lowest});
    at = first_not_below(first, end, {i, columns.j_end, lowest});
    if (first != at)
      visit(static_cast<std::size_t>(first - begin), static_cast<std::size_t>(at - begin));
    at = first_not_below(at, end, {i + 1, columns.j_begin, lowest});
  }
}

// Calls visit(position in grid.voxels) for each voxel of the columns, ascending.
template <typename Visit>
void visit_columns(const VoxelGrid& grid, const TileBounds& columns, const Visit& visit) {
  visit_rows(grid, columns, [&](std::size_t first, std::size_t last) {
    for (std::size_t at = first; at < last; ++at) visit(at);
  });
}

// `corrected`: index = floor(p / voxel_size_m) on the lattice through the frame's origin, so that a
// point lies in the same voxel whatever else is in the cloud. Throws Error naming voxel_size_m if
// an index would leave +-2^29 (it says how much memory a bit per voxel would take).
VoxelGrid voxelize(const std::vector<Eigen::Vector3d>& points_in_terrain, double voxel_size_m);

// The mean of the points in each voxel of the same lattice, voxels ascending, with the sum of their
// normals if they have normals: where a scan is denser, its points have no more weight. Throws as
// `voxelize`.
libmap::PointCloud voxel_means(const libmap::PointCloud& terrain, double voxel_size_m);

// `thesis` (listing A.4), in single precision: the centroid of each cell of one lattice, put into
// the cells of a second one that begins at the smallest coordinates of the points.
VoxelGrid voxelize_thesis(const std::vector<Eigen::Vector3f>& points_in_terrain,
                          double voxel_size_m);

// The centroid of the points in each cell floor(p * (1 / leaf_m)) in single precision, cells in
// ascending order of z, y, x (what the author's program does before and in the voxelization).
std::vector<Eigen::Vector3f> thin_to_centroids(const std::vector<Eigen::Vector3f>& points,
                                               double leaf_m);

// Throws Error naming the field if it is missing.
const std::vector<double>& values_of(const libmap::PointCloud& map, const char* name);

class VoxelFields {
 public:
  // Throws Error naming the field that is missing. The map outlives it and keeps its fields.
  explicit VoxelFields(const libmap::PointCloud& map);

  // Of point n. Throws Error naming the field whose value is no whole number within +-2^29.
  Voxel at(std::size_t n) const;
  // Of all points.
  std::vector<Voxel> all() const;

 private:
  int index(std::size_t axis, std::size_t n) const;

  std::array<const std::vector<double>*, 3> values_{};
};

}  // namespace libgtd
