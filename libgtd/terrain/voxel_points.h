// What the points in each voxel know of the surface in it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

struct VoxelPoints {
  // Mean of the points in the voxel, meters; the voxel's center where there is none.
  std::vector<Eigen::Vector3d> centroids;
  // Sum of their normals, each of unit length; zero where none is known.
  std::vector<Eigen::Vector3f> outsides;
};

// Of each of `voxels`, which ascend. Depends on the points in a voxel and their order alone.
VoxelPoints points_of_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                             const std::vector<Voxel>& voxels);

}  // namespace libgtd
