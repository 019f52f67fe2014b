// Statistics of a graspability map: distribution of scores, and graspable area by height and slope.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

// Bins of equal width; edges are multiples of the width.
struct ValueBins {
  double first_edge = 0.0;
  double width = 1.0;
  std::size_t count = 0;

  double low(std::size_t bin) const { return first_edge + static_cast<double>(bin) * width; }
  double high(std::size_t bin) const { return first_edge + static_cast<double>(bin + 1) * width; }
  // Returns the bin with low <= value < high; the first or last bin for values outside.
  std::size_t bin_of(double value) const;
};

// Returns bins from the bin with `low` to the bin that contains `high` or ends at `high`.
// Throws Error naming `field` for a width <= 0 and for more than 100,000 bins.
ValueBins bins_over(double low, double high, double width, const char* field);

// Returns the index of the quantile `fraction` (nearest rank) of `count` > 0 ascending values.
std::size_t nearest_rank(std::size_t count, double fraction);

struct MapAnalysisOptions {
  double score_bin = 0.05;  // widths of the bins of score, height and slope
  double height_bin_m = 0.05;
  double slope_bin_deg = 5.0;
  bool border = false;  // true: voxels at the border of the scanned area are evaluated, too
};
void bind(libmap::ParameterTable& table, MapAnalysisOptions& options);

// Numbers of voxels with low <= score < high; the last bin includes its upper end. A score up to
// 1e-6 below `low` belongs to the bin, as in the legend of the map (score_color.h).
struct ScoreBin {
  double low = 0.0;
  double high = 0.0;
  std::size_t all = 0;
  std::size_t above_zero_plane = 0;
  std::size_t evaluated = 0;  // VoxelMap::evaluated
  std::size_t graspable = 0;  // graspable voxels among the evaluated voxels
  double area_m2 = 0.0;       // surface area of the evaluated voxels
};

// Evaluated voxels with low <= height (m) or slope (degrees) < high; the last bin includes `high`.
struct GroundBin {
  double low = 0.0;
  double high = 0.0;
  std::size_t voxels = 0;
  std::size_t graspable_voxels = 0;
  double area_m2 = 0.0;
  double graspable_area_m2 = 0.0;
  double score_sum = 0.0;  // sum over the voxels

  std::optional<double> graspable_fraction() const;  // fraction of the area; nullopt without area
  std::optional<double> mean_score() const;          // nullopt without voxels
};

struct MapAnalysis {
  // Numbers of voxels in the whole map.
  std::size_t voxels = 0;
  std::size_t without_score = 0;
  std::size_t below_zero_plane = 0;
  std::size_t at_border = 0;
  std::size_t obstacles = 0;
  std::size_t graspable = 0;
  // Evaluated voxels only. A column consists of all voxels with the same i and j; it is graspable
  // if one of its evaluated voxels is.
  std::size_t columns = 0;
  std::size_t graspable_columns = 0;
  // Area projected to the horizontal plane; a voxel of unknown slope counts with its whole area.
  double plan_area_m2 = 0.0;
  double graspable_plan_area_m2 = 0.0;
  GroundBin ground;  // all evaluated voxels; low, high: range of heights
  // Occupied columns / (occupied + empty columns) of the whole map. Empty columns are counted only
  // in gaps of at most six columns along y. Below 1 if points are too sparse for the columns.
  double column_coverage = 1.0;
  std::vector<ScoreBin> score_classes;  // classes of the map's legend, best first (high: infinity)
  std::vector<ScoreBin> score_bins;     // from min(0, lowest score) to max(1, highest)
  std::vector<GroundBin> by_height;     // heights in the terrain frame
  std::vector<GroundBin> by_slope;      // from 0 to 90 degrees
};

// Computes the statistics. Throws Error for options out of range, more than 100,000 bins and a
// surface of a different size than the map.
MapAnalysis analyze_map(const VoxelMap& map, const MapSurface& surface,
                        const MapAnalysisOptions& options = {});

}  // namespace libgtd
