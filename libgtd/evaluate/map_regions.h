// Finds connected regions of graspable voxels, and the regions that a robot can reach.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

struct MapRegionOptions {
  int adjacency_voxels = 1;  // maximum difference of i, j and k of neighbors; 1: 26 neighbors
  int min_voxels = 1;        // minimum number of voxels of a region
  bool border = false;       // true: voxels at the border of the scanned area are evaluated, too
};
void bind(libmap::ParameterTable& table, MapRegionOptions& options);

struct MapRegion {
  std::vector<std::uint32_t> voxels;  // indices of map voxels, ascending
  double area_m2 = 0.0;               // surface area
  double plan_area_m2 = 0.0;          // area projected to the horizontal plane
  // Mean of the voxel centers, weighted by area, and their bounding box, in the terrain frame.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
  std::uint32_t best_voxel = 0;  // voxel with the largest score, first of equal ones
  double best_score = 0.0;
  double mean_score = 0.0;
};

struct MapRegionResult {
  std::vector<MapRegion> regions;             // descending by area, then by first voxel
  std::vector<std::int32_t> region_of_voxel;  // index into `regions`; -1: none
  std::size_t voxels = 0;                     // voxels in regions
  std::size_t skipped_regions = 0;            // regions smaller than min_voxels
  std::size_t skipped_voxels = 0;
};

// Finds connected components of the evaluated graspable voxels. Throws Error for options out of
// range and a surface of a different size than the map.
MapRegionResult find_regions(const VoxelMap& map, const MapSurface& surface,
                             const MapRegionOptions& options = {});

struct RegionReachOptions {
  double stride_m = 0.3;  // maximum step between voxel centers
  // Position of the robot in the terrain frame, m; nullopt: on the largest region.
  std::optional<Eigen::Vector3d> start{};
};
void bind(libmap::ParameterTable& table, RegionReachOptions& options);

// Link between two regions at their nearest voxels (any of equally near ones).
struct RegionLink {
  std::uint32_t a = 0;  // indices of regions, a < b
  std::uint32_t b = 0;
  double distance_m = 0.0;
  std::uint32_t voxel_a = 0;  // indices of map voxels
  std::uint32_t voxel_b = 0;
};

// Reachability of a region from the start of the robot.
struct RegionAccess {
  std::uint32_t group = 0;  // index of the group of linked regions; groups ascend by first region
  bool reachable = false;
  std::optional<std::size_t> steps;  // minimum number of steps, from the start to a region and
                                     // between regions; nullopt: unreachable
  double stride_needed_m = 0.0;      // minimum stride with which the region is reachable
};

struct RegionReach {
  std::vector<RegionLink> links;     // pairs within the stride, ascending by a, then b
  std::vector<RegionLink> tree;      // minimum spanning tree of all regions, shortest first
  std::vector<RegionAccess> access;  // one per region
  std::size_t groups = 0;            // number of groups of linked regions
  // Minimum stride that connects all regions: the longest link of the tree; 0 for one region,
  // nullopt for none.
  std::optional<double> joining_stride_m;
  std::optional<std::uint32_t> start_region;  // region nearest to the start; nullopt: no region
  double start_distance_m = 0.0;              // from the start to the nearest voxel of a region
  std::size_t reachable_regions = 0;
  double reachable_area_m2 = 0.0;
};

// Links regions whose nearest voxels are at most one stride apart, whatever is between them, and
// finds the regions that the robot can reach. Throws Error for options out of range and for a
// stride with more than 10 million links.
RegionReach find_reach(const VoxelMap& map, const MapRegionResult& regions,
                       const RegionReachOptions& options = {});

}  // namespace libgtd
