// Grippers and terrains for the tests of scoring.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/point_cloud.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline libgtd::Gripper gripper_named(const std::string& name) {
  return libgtd::read_gripper(source_folder() / "data/grippers" / (name + ".yaml"));
}

inline libgtd::TileBounds whole_box(const libgtd::VoxelGrid& grid) {
  return {grid.min.i, grid.max.i + 1, grid.min.j, grid.max.j + 1};
}

// Returns a grid of the given voxels on a lattice of 1 cm.
inline libgtd::VoxelGrid grid_of(std::vector<libgtd::Voxel> voxels) {
  std::vector<Eigen::Vector3d> centers;
  const libgtd::VoxelLattice lattice;
  for (const libgtd::Voxel& voxel : voxels) centers.push_back(lattice.center_of(voxel));
  return libgtd::voxelize(centers, 0.01);
}

// Returns rough ground of side x side columns with bumps, a few overhangs and holes.
inline std::vector<libgtd::Voxel> random_ground(int side, int first_i = 0, int first_j = 0) {
  std::vector<libgtd::Voxel> voxels;
  const double phase = uniform(0.0, 6.0);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      if (uniform(0.0, 1.0) < 0.05) continue;
      const double height =
          5.0 * std::sin(0.2 * i + phase) * std::cos(0.15 * j) + uniform(-1.5, 1.5);
      const int k = static_cast<int>(std::floor(height));
      voxels.push_back({first_i + i, first_j + j, k});
      if (uniform(0.0, 1.0) < 0.1) voxels.push_back({first_i + i, first_j + j, k + 4});
    }
  return voxels;
}

// Returns a smooth terrain in the terrain frame as a cloud: bumps of 5 to 12 cm on a floor.
inline libmap::PointCloud bumpy_cloud(double side_m, double spacing_m) {
  libmap::PointCloud cloud;
  for (double x = -side_m / 2; x <= side_m / 2; x += spacing_m)
    for (double y = -side_m / 2; y <= side_m / 2; y += spacing_m)
      cloud.positions.emplace_back(
          x, y, 0.06 * std::sin(9.0 * x) * std::sin(8.0 * y) + 0.02 * std::sin(31.0 * x + y));
  return cloud;
}

}  // namespace graspmap_test
