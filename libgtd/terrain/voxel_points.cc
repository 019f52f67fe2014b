#include "libgtd/terrain/voxel_points.h"

#include <algorithm>
#include <cstddef>

#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

// For each point the place of its voxel in the list, or voxels.size().
std::vector<std::size_t> find_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                                     const std::vector<Voxel>& voxels) {
  std::vector<std::size_t> places(terrain.size(), voxels.size());
  libmap::parallel_for(terrain.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      if (!terrain.positions[n].allFinite()) continue;
      const Voxel voxel = lattice.voxel_of(terrain.positions[n]);
      const auto found = std::lower_bound(voxels.begin(), voxels.end(), voxel);
      if (found != voxels.end() && *found == voxel)
        places[n] = static_cast<std::size_t>(found - voxels.begin());
    }
  });
  return places;
}

}  // namespace

VoxelPoints points_of_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                             const std::vector<Voxel>& voxels) {
  const std::vector<std::size_t> places = find_voxels(terrain, lattice, voxels);
  VoxelPoints result;
  result.outsides.assign(voxels.size(), Eigen::Vector3f::Zero());
  std::vector<Eigen::Vector3d> offsets(voxels.size(), Eigen::Vector3d::Zero());
  std::vector<double> counts(voxels.size(), 0.0);
  for (std::size_t n = 0; n < terrain.size(); ++n) {
    const std::size_t at = places[n];
    if (at == voxels.size()) continue;
    // Relative to the voxel, so that a point far from the origin is as exact as one near it.
    offsets[at] += terrain.positions[n] - lattice.center_of(voxels[at]);
    counts[at] += 1.0;
    if (!terrain.has_normals()) continue;
    const Eigen::Vector3f& normal = terrain.normals[n];
    if (normal.allFinite() && normal.norm() > 0.0F) result.outsides[at] += normal.normalized();
  }
  result.centroids.reserve(voxels.size());
  for (std::size_t at = 0; at < voxels.size(); ++at)
    result.centroids.push_back(lattice.center_of(voxels[at]) +
                               offsets[at] / std::max(counts[at], 1.0));
  return result;
}

}  // namespace libgtd
