// Sparse set of the occupied voxels of a terrain.
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
  Voxel min;                  // box of the grid, may be larger than the box of `voxels`
  Voxel max;
};

// Rectangle of voxel columns, [begin, end) in i and j.
struct TileBounds {
  int i_begin = 0;
  int i_end = 0;
  int j_begin = 0;
  int j_end = 0;
};

// Returns the first iterator in at..end with a voxel not below `voxel` (exponential search, fast if
// the result is near `at`).
template <typename Iterator>
Iterator advance_lower_bound(Iterator at, Iterator end, const Voxel& voxel) {
  auto step = typename std::iterator_traits<Iterator>::difference_type{1};
  while (step < end - at && *(at + step) < voxel) {
    at += step;
    step *= 2;
  }
  return std::lower_bound(at, step < end - at ? at + step : end, voxel);
}

// Calls visit(n, m), n < m, for each pair of the ascending voxels that are at most `reach` apart
// along each axis.
template <typename Visit>
void visit_pairs(const std::vector<Voxel>& voxels, int reach, const Visit& visit) {
  // For each row i .. i + reach, the first voxel of the columns j - reach .. j + reach. It only
  // advances.
  std::vector<std::vector<Voxel>::const_iterator> firsts(static_cast<std::size_t>(reach) + 1,
                                                         voxels.begin());
  constexpr int lowest = std::numeric_limits<int>::min();
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Voxel& voxel = voxels[n];
    for (int di = 0; di <= reach; ++di) {
      auto& first = firsts[static_cast<std::size_t>(di)];
      first = advance_lower_bound(first, voxels.end(), {voxel.i + di, voxel.j - reach, lowest});
      for (auto at = first; at != voxels.end() && at->i == voxel.i + di && at->j <= voxel.j + reach;
           ++at) {
        const auto m = static_cast<std::size_t>(at - voxels.begin());
        if (m > n && std::abs(at->k - voxel.k) <= reach) visit(n, m);
      }
    }
  }
}

// Returns the number of voxels without an occupied voxel among the 26 neighbors.
std::size_t count_isolated(const std::vector<Voxel>& voxels);

// Throws Error naming the share of isolated voxels if it exceeds 60 % of at least 10 voxels: such
// points do not form a surface at this voxel size. Points in a regular grid have 100 % at a spacing
// of more than two voxels, and less than 50 % at 1.5 voxels. The thesis's cloud of scenario 2 has
// 54 % at its voxel size and must be accepted.
void require_dense(std::size_t isolated, std::size_t voxels, double voxel_size_m,
                   const std::vector<Eigen::Vector3d>& points);

// Calls visit(first, last) for each row in the columns, ascending. A row consists of the voxels of
// one i: grid.voxels[first .. last - 1].
template <typename Visit>
void visit_rows(const VoxelGrid& grid, const TileBounds& columns, const Visit& visit) {
  const auto begin = grid.voxels.begin();
  const auto end = grid.voxels.end();
  constexpr int lowest = std::numeric_limits<int>::min();
  auto at = std::lower_bound(begin, end, Voxel{columns.i_begin, columns.j_begin, lowest});
  while (at != end && at->i < columns.i_end) {
    const int i = at->i;
    const auto first = advance_lower_bound(at, end, {i, columns.j_begin, lowest});
    at = advance_lower_bound(first, end, {i, columns.j_end, lowest});
    if (first != at)
      visit(static_cast<std::size_t>(first - begin), static_cast<std::size_t>(at - begin));
    at = advance_lower_bound(at, end, {i + 1, columns.j_begin, lowest});
  }
}

// Calls visit(index in grid.voxels) for each voxel of the columns, ascending.
template <typename Visit>
void visit_columns(const VoxelGrid& grid, const TileBounds& columns, const Visit& visit) {
  visit_rows(grid, columns, [&](std::size_t first, std::size_t last) {
    for (std::size_t at = first; at < last; ++at) visit(at);
  });
}

// Voxelizes points (terrain frame, m) for the method `corrected`: index = floor(p / voxel_size_m)
// on the lattice through the origin, independent of the rest of the cloud. Throws Error naming
// voxel_size_m if an index is outside +-2^29.
VoxelGrid voxelize(const std::vector<Eigen::Vector3d>& points_in_terrain, double voxel_size_m);

// Returns the mean of the points in each voxel of the lattice of voxelize(), ascending by voxel,
// with the sum of the normals if the cloud has normals. The means do not depend on scan density.
// Throws like voxelize.
libmap::PointCloud voxel_means(const libmap::PointCloud& terrain, double voxel_size_m);

// Voxelizes points for the method `thesis` (listing A.4), in single precision: the centroids of the
// cells of one lattice are put into the cells of a second lattice, which starts at the minimum of
// the points.
VoxelGrid voxelize_thesis(const std::vector<Eigen::Vector3f>& points_in_terrain,
                          double voxel_size_m);

// Returns the centroid of the points in each cell floor(p * (1 / leaf_m)) in single precision, in
// ascending order of z, y, x, as the thesis's program does before and during voxelization.
std::vector<Eigen::Vector3f> voxel_centroids(const std::vector<Eigen::Vector3f>& points,
                                             double leaf_m);

// Returns the values of the field `name`. Throws Error naming the field if it is missing.
const std::vector<double>& values_of(const libmap::PointCloud& map, const char* name);

// Voxel indices of map points, from the fields i, j and k.
class VoxelFields {
 public:
  // Throws Error naming a missing field. The map must outlive this object.
  explicit VoxelFields(const libmap::PointCloud& map);

  // Returns the voxel of point n. Throws Error naming the field if a value is not an integer within
  // +-2^29.
  Voxel at(std::size_t n) const;
  // Returns the voxels of all points. Throws like at().
  std::vector<Voxel> all() const;

 private:
  int index(std::size_t axis, std::size_t n) const;

  std::array<const std::vector<double>*, 3> values_{};
};

}  // namespace libgtd
