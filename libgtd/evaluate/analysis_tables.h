// Converts map analyses to tables, JSON and clouds. Regions are numbered from 1.
#pragma once

#include <string>
#include <vector>

#include "libgtd/evaluate/map_analysis.h"
#include "libgtd/evaluate/map_change.h"
#include "libgtd/evaluate/map_regions.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/table.h"

namespace libgtd {

// Returns one row per bin of the score histogram; the column `bins` is "class" for the score
// classes of the map's legend and "width" for bins of equal width.
libmap::Table histogram_table(const MapAnalysis& analysis);

// Returns one row per height bin (`unit` of the bounds "m") or slope bin (`unit` "deg").
libmap::Table ground_table(const std::vector<GroundBin>& bins, const std::string& unit);

// Returns one row per region: positions in the frame of the map, heights in the terrain frame.
libmap::Table regions_table(const VoxelMap& map, const MapRegionResult& regions,
                            const RegionReach& reach);

// Returns one row per pair of regions in RegionReach::links or RegionReach::tree, ascending.
libmap::Table region_links_table(const VoxelMap& map, const RegionReach& reach);

// Returns rows for all voxels that both maps have, for the voxels that are evaluated in both maps,
// and for each height bin and slope bin of the evaluated voxels.
libmap::Table change_table(const MapChange& change);

// Returns counts, areas, regions, reachability and (unless null) `change` as JSON.
std::string analysis_json(const MapAnalysis& analysis, const MapSurface& surface,
                          const MapRegionResult& regions, const RegionReachOptions& reach_options,
                          const RegionReach& reach, const MapChange* change);

// Returns the points of the map `cloud` in the same order, with the fields score, graspable (0 or
// 1), region (0: none), reachable (0 or 1), slope_deg (NaN: unknown) and area_m2.
libmap::PointCloud regions_cloud(const libmap::PointCloud& cloud, const VoxelMap& map,
                                 const MapSurface& surface, const MapRegionResult& regions,
                                 const RegionReach& reach);

}  // namespace libgtd
