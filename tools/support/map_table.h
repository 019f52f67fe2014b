// Compares several maps in one table, one row per map, for `graspmap analyze MAP MAP...`.
#pragma once

#include "libmap/core/parameters.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

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
