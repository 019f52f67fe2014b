// Converts map analyses to tables, JSON and clouds, in which regions are numbered from 1.
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

// Returns one row per pair of regions that is linked within the stride or by the spanning tree.
libmap::Table region_links_table(const VoxelMap& map, const RegionReach& reach);

// Returns one row for all common voxels, one row for the evaluated common voxels, and one row per
// height bin and per slope bin of the evaluated common voxels.
libmap::Table change_table(const MapChange& change);

// Returns counts, areas, regions and reach as JSON, and `change` unless it is null.
std::string analysis_json(const MapAnalysis& analysis, const MapSurface& surface,
                          const MapRegionResult& regions, const RegionReachOptions& reach_options,
                          const RegionReach& reach, const MapChange* change);

// Returns the points of `cloud`, the map, in the same order with the fields score, graspable,
// region (0: none), reachable (0 or 1), slope_deg (NaN: unknown) and area_m2.
libmap::PointCloud regions_cloud(const libmap::PointCloud& cloud, const VoxelMap& map,
                                 const MapSurface& surface, const MapRegionResult& regions,
                                 const RegionReach& reach);

}  // namespace libgtd
