// Analyses of maps as tables and JSON. Regions are numbered from 1 on, as in the clouds.
#pragma once

#include <string>
#include <vector>

#include "libgtd/evaluate/map_analysis.h"
#include "libgtd/evaluate/map_change.h"
#include "libgtd/evaluate/map_regions.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/table.h"

namespace libgtd {

// One row a bin; column `bins` is "class" for those of the legend, "width" for the finer ones.
libmap::Table histogram_table(const MapAnalysis& analysis);

// One row a bin; `unit` is that of its bounds, "m" or "deg".
libmap::Table ground_table(const std::vector<GroundBin>& bins, const std::string& unit);

// One row a region; places in the frame of the map's points.
libmap::Table regions_table(const VoxelMap& map, const MapRegionResult& regions,
                            const RegionReach& reach);

// One row a pair of regions that the stride or the spanning tree joins.
libmap::Table region_links_table(const VoxelMap& map, const RegionReach& reach);

// Rows: all voxels in common, those evaluated, and these by height and by slope.
libmap::Table change_table(const MapChange& change);

// Counts, areas, regions and reach; `change` may be null.
std::string analysis_json(const MapAnalysis& analysis, const MapSurface& surface,
                          const MapRegionResult& regions, const RegionReachOptions& reach_options,
                          const RegionReach& reach, const MapChange* change);

// The map's points with the fields region (0: none), reachable, slope_deg and area_m2, in the order
// of `cloud`, without the others' fields but score and graspable.
libmap::PointCloud regions_cloud(const libmap::PointCloud& cloud, const VoxelMap& map,
                                 const MapSurface& surface, const MapRegionResult& regions,
                                 const RegionReach& reach);

}  // namespace libgtd
