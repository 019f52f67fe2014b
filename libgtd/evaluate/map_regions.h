// Where a map's ground can be held without a gap: regions of graspable voxels.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

struct MapRegionOptions {
  int adjacency_voxels = 1;  // of one region: indices differ by at most so much; 1: 26 neighbors
  int min_voxels = 1;        // smaller regions are left out
  bool border = false;       // voxels whose mask's window leaves the scanned area count too
};
void bind(libmap::ParameterTable& table, MapRegionOptions& options);

struct MapRegion {
  std::vector<std::uint32_t> voxels;  // entries of the map, ascending
  double area_m2 = 0.0;               // of the surface
  double plan_area_m2 = 0.0;          // the same seen from above
  // In the terrain frame: mean of the voxels' centers, weighted by their areas; box around them.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
  std::uint32_t best_voxel = 0;  // with the largest score, of equals the first
  double best_score = 0.0;
  double mean_score = 0.0;
};

struct MapRegionResult {
  std::vector<MapRegion> regions;  // the largest area first, of equals the first voxel decides
  std::vector<std::int32_t> region_of_voxel;  // index into `regions`; -1: none
  std::size_t voxels = 0;                     // in regions
  std::size_t left_out_regions = 0;           // smaller than min_voxels
  std::size_t left_out_voxels = 0;
};

// Connected components of the evaluated graspable voxels. Throws Error: options out of their
// bounds.
MapRegionResult find_regions(const VoxelMap& map, const MapSurface& surface,
                             const MapRegionOptions& options = {});

}  // namespace libgtd
