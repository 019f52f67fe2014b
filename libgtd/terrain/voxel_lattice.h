// Conversions between points and voxels. Points are in the terrain frame, in meters.
#pragma once

#include <Eigen/Core>
#include <compare>

namespace libgtd {

// std::floor for values within the range of Integer, without a library call.
template <typename Integer, typename Real>
constexpr Integer floor_to(Real value) {
  const auto whole = static_cast<Integer>(value);
  return static_cast<Real>(whole) > value ? whole - 1 : whole;
}

// Bound of voxel indices (+-2^29), so that sums and differences of indices fit an int.
inline constexpr double max_voxel_index = 0x1p29;

// Voxel index. All lists of voxels and all maps are ordered by i, then j, then k.
struct Voxel {
  int i = 0;
  int j = 0;
  int k = 0;
  auto operator<=>(const Voxel&) const = default;
};

// Lattice of cubes with edge voxel_size_m; `origin_m` is the lowest corner of voxel (0, 0, 0). A
// point on a face between two voxels belongs to the voxel with the larger index.
struct VoxelLattice {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();
  double voxel_size_m = 0.01;

  // Returns the position in voxels from the origin, not rounded.
  Eigen::Vector3d cell_of(const Eigen::Vector3d& point_in_terrain) const {
    return (point_in_terrain - origin_m) / voxel_size_m;
  }
  Voxel voxel_of(const Eigen::Vector3d& point_in_terrain) const {
    const Eigen::Vector3d cell = cell_of(point_in_terrain);
    return {floor_to<int>(cell.x()), floor_to<int>(cell.y()), floor_to<int>(cell.z())};
  }
  Eigen::Vector3d center_of(const Voxel& voxel) const {
    return origin_m +
           voxel_size_m * (Eigen::Vector3d(voxel.i, voxel.j, voxel.k).array() + 0.5).matrix();
  }
};

// Lattice of method `thesis`, in single precision as in the author's program: indices start at the
// minimum coordinates of the cloud, and a quarter of the voxel size in meters is added to an index
// before truncation.
struct ThesisLattice {
  Eigen::Vector3f min_m = Eigen::Vector3f::Zero();
  float voxel_size_m = 0.01F;

  Voxel voxel_of(const Eigen::Vector3f& centroid) const {
    const Eigen::Vector3f index = ((centroid - min_m) / voxel_size_m).array() + voxel_size_m / 4.0F;
    return {static_cast<int>(index.x()), static_cast<int>(index.y()), static_cast<int>(index.z())};
  }
  // Returns the numbers of voxels along i, j, k up to the maximum coordinates of the cloud.
  Voxel size_to(const Eigen::Vector3f& max_m) const {
    const Eigen::Vector3f cells = (max_m - min_m) / voxel_size_m;
    return {static_cast<int>(cells.x()) + 1, static_cast<int>(cells.y()) + 1,
            static_cast<int>(cells.z()) + 1};
  }
  VoxelLattice lattice() const { return {min_m.cast<double>(), static_cast<double>(voxel_size_m)}; }
};

// Integer division that rounds toward minus infinity, unlike '/'.
constexpr int floor_divide(int dividend, int divisor) {
  const int quotient = dividend / divisor;
  return dividend % divisor != 0 && (dividend < 0) != (divisor < 0) ? quotient - 1 : quotient;
}

}  // namespace libgtd
