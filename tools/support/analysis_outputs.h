// Outputs of `graspmap analyze`: images and charts of the analysis of a map, and a table of several
// maps with one row per map.
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

// Score histogram: bars of the evaluated voxels in the legend's colors, and a line for all voxels.
libmap::Chart histogram_chart(const libgtd::MapAnalysis& analysis, const std::string& title);

// Returns a chart of the ground by height or slope: bars are the graspable share of a bin, a line
// shows the bin's share of all ground.
libmap::Chart ground_chart(const std::vector<libgtd::GroundBin>& bins,
                           const std::string& axis_title, const std::string& title);

struct MapImage {
  const libgtd::VoxelMap& map;
  const libgtd::MapSurface& surface;
  std::string title;
};

// Draws the map from above: regions colored by reachability, the largest ones numbered, other
// ground darker with slope.
libmap::ColorImage draw_regions(const MapImage& image, const libgtd::MapRegionResult& regions,
                                const libgtd::RegionReach& reach);

// Draws the map from above, with voxels that are graspable in both maps or in one only.
libmap::ColorImage draw_change(const MapImage& image, const libgtd::MapChange& change,
                               const libgtd::VoxelMap& other,
                               const libmap::Pose& map_terrain_from_other_terrain);

// Draws the map from above, colored by the difference of both scores.
libmap::ColorImage draw_score_change(const MapImage& image, const libgtd::MapChange& change,
                                     const libgtd::VoxelMap& other);

struct MapTableOptions {
  std::string expected;  // CSV of regions of expected graspability; empty: none
  PointFrame points_frame = PointFrame::input;  // frame of these regions
  std::string cutoff = "auto";                  // minimum score, or each map's own threshold
  std::string names;                            // separated by '|'
  bool pairs = false;
  std::string varied;  // column of maps.csv, the horizontal axis of charts; empty: no such charts
  std::string series;  // columns of maps.csv, separated by ',': one curve per combination
  bool images = true;
};

// Binds all options except `expected`, `points_frame` and `images`.
void bind(libmap::ParameterTable& table, MapTableOptions& options);

// Writes maps.csv, histograms.csv with a chart and, if requested, pairs.csv, regions.csv and charts
// of graspable_share, voxel_youden and place_youden against the varied parameter into `folder`.
// Throws Error naming the invalid map or table.
void tabulate_maps(const std::vector<std::string>& map_files, const std::string& folder,
                   const MapTableOptions& options, Run& run);

}  // namespace graspmap_tools
