// Where a map's ground can be held without a gap: regions of graspable voxels.
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

struct RegionReachOptions {
  double stride_m = 0.3;  // the longest step, from voxel center to voxel center
  // Where the robot stands, in the terrain frame; nothing: on the largest region.
  std::optional<Eigen::Vector3d> start{};
};
void bind(libmap::ParameterTable& table, RegionReachOptions& options);

// Two regions at the voxels where they come nearest to each other; of equals, any.
struct RegionLink {
  std::uint32_t a = 0;  // a < b, indices of regions
  std::uint32_t b = 0;
  double distance_m = 0.0;
  std::uint32_t voxel_a = 0;  // entries of the map
  std::uint32_t voxel_b = 0;
};

// Of one region, from the start.
struct RegionAccess {
  std::uint32_t group = 0;  // regions joined by steps; numbered by their first regions
  bool reachable = false;
  std::optional<std::size_t> steps;  // fewest steps between regions (and from the start to the
                                     // first); nothing where it cannot be reached
  double stride_needed_m = 0.0;      // the shortest stride that reaches it, over all ways
};

struct RegionReach {
  std::vector<RegionLink> links;     // all pairs within the stride, ascending by a, then b
  std::vector<RegionLink> tree;      // minimum spanning tree of all regions, shortest first
  std::vector<RegionAccess> access;  // one a region
  std::size_t groups = 0;
  // The shortest stride that joins all regions: the longest link of the tree; 0 for one region,
  // nothing for none.
  std::optional<double> joining_stride_m;
  std::optional<std::uint32_t> start_region;  // the nearest to the start
  double start_distance_m = 0.0;              // to it
  std::size_t reachable_regions = 0;
  double reachable_area_m2 = 0.0;
};

// The graph whose nodes are regions, linked where their nearest voxels lie within the stride.
// Nothing that lies between is looked at: walls and gaps do not stop a step. Throws Error: options
// out of their bounds, or a stride with more than 10 million links.
RegionReach find_reach(const VoxelMap& map, const MapRegionResult& regions,
                       const RegionReachOptions& options = {});

}  // namespace libgtd
