// The pictures and charts of an analysis of maps.
#pragma once

#include <string>
#include <vector>

#include "libgtd/evaluate/map_analysis.h"
#include "libgtd/evaluate/map_change.h"
#include "libgtd/evaluate/map_regions.h"
#include "libmap/core/image.h"
#include "libmap/view/charts.h"

namespace graspmap_tools {

// Bars of the evaluated voxels in the legend's colors, and a line for all voxels.
libmap::Chart histogram_chart(const libgtd::MapAnalysis& analysis, const std::string& title);

// Bars: which share of the ground in a bin can be held. Line: which share of all ground is in it.
libmap::Chart ground_chart(const std::vector<libgtd::GroundBin>& bins,
                           const std::string& axis_title, const std::string& title);

struct MapPicture {
  const libgtd::VoxelMap& map;
  const libgtd::MapSurface& surface;
  std::string title;
};

// From above, ground the darker the steeper; regions by whether they can be reached, the largest
// ones with their numbers.
libmap::ColorImage draw_regions(const MapPicture& picture, const libgtd::MapRegionResult& regions,
                                const libgtd::RegionReach& reach);

// From above: where the two maps agree, and where only one of them says that it can be held.
libmap::ColorImage draw_change(const MapPicture& picture, const libgtd::MapChange& change,
                               const libgtd::VoxelMap& other,
                               const libmap::Pose& map_terrain_from_other_terrain);

// The same with the difference of the scores.
libmap::ColorImage draw_score_change(const MapPicture& picture, const libgtd::MapChange& change,
                                     const libgtd::VoxelMap& other);

}  // namespace graspmap_tools
