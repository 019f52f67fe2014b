// Makes the outputs of `graspmap analyze`: images and charts of one map, tables of several maps.
#pragma once

#include <string>
#include <vector>

#include "libgtd/evaluate/map_analysis.h"
#include "libgtd/evaluate/map_change.h"
#include "libgtd/evaluate/map_regions.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/view/charts.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

// Returns the score histogram: bars of the evaluated voxels by class, and a line of all voxels.
libmap::Chart histogram_chart(const libgtd::MapAnalysis& analysis, const std::string& title);

// Returns a chart of the ground by height or slope. Bars show the graspable share of each bin's
// area; a line shows the share of each bin in the area of all ground.
libmap::Chart ground_chart(const std::vector<libgtd::GroundBin>& bins,
                           const std::string& axis_title, const std::string& title);

struct MapImage {  // must not outlive `map` and `surface`
  const libgtd::VoxelMap& map;
  const libgtd::MapSurface& surface;
  std::string title;
};

// Draws the map from above. Regions are colored by reachability, and the eight largest are
// numbered. Other ground is gray, darker with increasing slope.
libmap::ColorImage draw_regions(const MapImage& image, const libgtd::MapRegionResult& regions,
                                const libgtd::RegionReach& reach);

// Draws the map from above, with colors for voxels that are graspable in both maps or in one only.
libmap::ColorImage draw_change(const MapImage& image, const libgtd::MapChange& change,
                               const libgtd::VoxelMap& other,
                               const libmap::Pose& map_terrain_from_other_terrain);

// Draws the voxels of both maps from above, colored by the score in `other` minus that in the map.
libmap::ColorImage draw_score_change(const MapImage& image, const libgtd::MapChange& change,
                                     const libgtd::VoxelMap& other);

struct MapTableOptions {
  std::string expected;                         // CSV of regions with expected result; empty: none
  PointFrame points_frame = PointFrame::input;  // frame of `expected`
  std::string cutoff = "auto";  // minimum score of a graspable voxel; auto: each map's threshold
  std::string names;            // names of the maps, separated by '|'; empty: names of the files
  bool pairs = false;           // true: compare all pairs of maps
  std::string varied;  // column of maps.csv that charts show on the horizontal axis; empty: none
  std::string series;  // columns of maps.csv, separated by ','; a curve per combination of values
  bool images = true;  // false: tables only, no charts
};

// Binds all options except `expected`, `points_frame` and `images`.
void bind(libmap::ParameterTable& table, MapTableOptions& options);

// Writes maps.csv, histograms.csv with a chart and, if requested, pairs.csv, regions.csv and charts
// of maps.csv (graspable_share, voxel_youden and place_youden by the varied column) into `folder`.
// Throws Error naming the file if a map or table is invalid.
void tabulate_maps(const std::vector<std::string>& map_files, const std::string& folder,
                   const MapTableOptions& options, Run& run);

}  // namespace graspmap_tools
