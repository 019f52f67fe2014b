// The terrain as a sparse set of occupied voxels.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"

namespace libgtd {

struct VoxelGrid {
  VoxelLattice lattice;
  std::vector<Voxel> voxels;  // occupied, ascending, each once
  Voxel min;                  // of the box of the grid; may be larger than that of the voxels
  Voxel max;

  double cells_in_box() const;
};

// A rectangle of voxel columns, [begin, end) in i and j.
struct TileBounds {
  int i_begin = 0;
  int i_end = 0;
  int j_begin = 0;
  int j_end = 0;
};

// Calls visit(position in grid.voxels) for each voxel of the columns, ascending.
template <typename Visit>
void visit_columns(const VoxelGrid& grid, const TileBounds& columns, const Visit& visit) {
  const auto begin = grid.voxels.begin();
  const auto end = grid.voxels.end();
  auto at = std::lower_bound(begin, end, Voxel{columns.i_begin, columns.j_begin, grid.min.k});
  while (at != end && at->i < columns.i_end) {
    if (at->j < columns.j_begin) {
      at = std::lower_bound(at, end, Voxel{at->i, columns.j_begin, grid.min.k});
    } else if (at->j >= columns.j_end) {
      at = std::lower_bound(at, end, Voxel{at->i + 1, columns.j_begin, grid.min.k});
    } else {
      visit(static_cast<std::size_t>(at - begin));
      ++at;
    }
  }
}

// `corrected`: index = floor(p / voxel_size_m) on the lattice through the frame's origin, so that a
// point lies in the same voxel whatever else is in the cloud. Throws Error naming voxel_size_m if
// an index would leave +-2^29 (it says how much memory a bit a voxel would take).
VoxelGrid voxelize(const std::vector<Eigen::Vector3d>& points_in_terrain, double voxel_size_m);

// `thesis` (listing A.4), in single precision: the centroid of each cell of one lattice, put into
// the cells of a second one that begins at the smallest coordinates of the points.
VoxelGrid voxelize_thesis(const std::vector<Eigen::Vector3f>& points_in_terrain,
                          double voxel_size_m);

// The centroid of the points in each cell floor(p * (1 / leaf_m)) in single precision, cells in
// ascending order of z, y, x (what the author's program does before and in the voxelization).
std::vector<Eigen::Vector3f> thin_to_centroids(const std::vector<Eigen::Vector3f>& points,
                                               double leaf_m);

}  // namespace libgtd
