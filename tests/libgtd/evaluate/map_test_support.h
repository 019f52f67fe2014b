// Makes maps from lists of voxels.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/point_cloud.h"

namespace graspmap_test {

inline constexpr double test_voxel_m = 0.01;

// Makes a map like `graspmap score`, on the lattice through the origin, graspable from 0.8.
inline libmap::PointCloud map_cloud(const std::vector<libgtd::Voxel>& voxels,
                                    const std::function<double(const libgtd::Voxel&)>& score_of) {
  const libgtd::VoxelLattice lattice{Eigen::Vector3d::Zero(), test_voxel_m};
  libmap::PointCloud cloud;
  for (const libgtd::Voxel& voxel : voxels) cloud.positions.push_back(lattice.center_of(voxel));
  const auto add = [&](const char* name, libmap::ScalarType type, const auto& value) {
    std::vector<double>& values = cloud.add_field(name, type).values;
    for (std::size_t n = 0; n < voxels.size(); ++n) values[n] = value(voxels[n]);
  };
  add("score", libmap::ScalarType::float32, score_of);
  add("graspable", libmap::ScalarType::uint8,
      [&](const libgtd::Voxel& voxel) { return score_of(voxel) >= 0.8 ? 1.0 : 0.0; });
  add("border", libmap::ScalarType::uint8, [](const libgtd::Voxel&) { return 0.0; });
  add("i", libmap::ScalarType::int32, [](const libgtd::Voxel& voxel) { return voxel.i; });
  add("j", libmap::ScalarType::int32, [](const libgtd::Voxel& voxel) { return voxel.j; });
  add("k", libmap::ScalarType::int32, [](const libgtd::Voxel& voxel) { return voxel.k; });
  return cloud;
}

// Returns a level floor of `width` x `depth` voxels at k = 0.
inline std::vector<libgtd::Voxel> floor_voxels(int width, int depth) {
  std::vector<libgtd::Voxel> voxels;
  for (int i = 0; i < width; ++i)
    for (int j = 0; j < depth; ++j) voxels.push_back({i, j, 0});
  return voxels;
}

// Returns a surface in which each voxel is one level face.
inline libgtd::MapSurface level_surface(const libgtd::VoxelMap& map) {
  libgtd::MapSurface surface;
  surface.slope_deg.assign(map.size(), 0.0F);
  surface.area_m2.assign(map.size(), static_cast<float>(test_voxel_m * test_voxel_m));
  return surface;
}

}  // namespace graspmap_test
