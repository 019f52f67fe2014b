// What a map says as a whole: how its scores spread, and how much ground can be held, at which
// height and slope.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

// Bins of one width whose edges are multiples of it.
struct ValueBins {
  double first_edge = 0.0;
  double width = 1.0;
  std::size_t count = 0;

  double low(std::size_t bin) const { return first_edge + static_cast<double>(bin) * width; }
  double high(std::size_t bin) const { return first_edge + static_cast<double>(bin + 1) * width; }
  // The bin with low <= value < high; values beyond the ends belong to the first and the last.
  std::size_t bin_of(double value) const;
};

// From the bin with `low` to the one that ends at `high` or holds it within. Throws Error naming
// `field` if there were more than 100,000.
ValueBins bins_over(double low, double high, double width, const char* field);

// Index of the quantile `share` by nearest rank, of `count` > 0 values in ascending order.
std::size_t nearest_rank(std::size_t count, double share);

struct MapAnalysisOptions {
  double score_bin = 0.05;  // width of the histogram's bins
  double height_bin_m = 0.05;
  double slope_bin_deg = 5.0;
  bool border = false;  // voxels whose mask's window leaves the scanned area count too
};
void bind(libmap::ParameterTable& table, MapAnalysisOptions& options);

// Voxels with low <= score < high; a score that is the upper end of all bins is in the last one.
// Bounds are met from 1e-6 below, as in the map's legend (score_color.h).
struct ScoreBin {
  double low = 0.0;
  double high = 0.0;
  std::size_t all = 0;
  std::size_t above_zero_plane = 0;
  std::size_t evaluated = 0;  // VoxelMap::evaluated
  std::size_t graspable = 0;  // of those evaluated
  double area_m2 = 0.0;       // of those evaluated
};

// Evaluated voxels with low <= value < high; the last bin holds its high end too.
struct GroundBin {
  double low = 0.0;
  double high = 0.0;
  std::size_t voxels = 0;
  std::size_t graspable_voxels = 0;
  double area_m2 = 0.0;
  double graspable_area_m2 = 0.0;
  double score_sum = 0.0;

  std::optional<double> graspable_share() const;  // of the area
  std::optional<double> mean_score() const;  // of its evaluated voxels; nothing if there is none
};

struct MapAnalysis {
  // Of all voxels.
  std::size_t voxels = 0;
  std::size_t without_score = 0;
  std::size_t below_zero_plane = 0;
  std::size_t at_border = 0;
  std::size_t obstacles = 0;
  std::size_t graspable = 0;
  // Of the evaluated voxels. A column is all voxels with the same i and j; it is graspable if one
  // of its voxels is.
  std::size_t columns = 0;
  std::size_t graspable_columns = 0;
  double plan_area_m2 = 0.0;  // of the surface, seen from above
  double graspable_plan_area_m2 = 0.0;
  GroundBin ground;  // all evaluated voxels; low and high are the least and the largest height
  // Share of the columns with a voxel among these and the empty ones between them (at most six in a
  // row along y), of the whole map: less than 1 where the cloud has fewer points than columns.
  double column_coverage = 1.0;
  std::vector<ScoreBin> classes;     // of the legend, the best first
  std::vector<ScoreBin> score_bins;  // from 0 or the least score to 1 or the largest, ascending
  std::vector<GroundBin> by_height;  // ascending; heights in the terrain frame
  std::vector<GroundBin> by_slope;   // from 0 to 90 degrees
};

// Throws Error: options out of their bounds, or bins so narrow that there are more than 100,000.
MapAnalysis analyze_map(const VoxelMap& map, const MapSurface& surface,
                        const MapAnalysisOptions& options = {});

}  // namespace libgtd
