// Summarizes several maps in one table row each: parameters of the detection, distribution of
// scores, and agreement with expected regions, if known.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/evaluate/expected_map.h"
#include "libgtd/evaluate/map_analysis.h"
#include "libgtd/evaluate/map_change.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/manifest.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/table.h"

namespace libgtd {

inline constexpr std::array<double, 5> summary_quantiles{0.05, 0.25, 0.5, 0.75, 0.95};

// Statistics of the evaluated voxels (VoxelMap::evaluated), which have a score, are above the zero
// plane, and have the whole window of the mask in the scanned area.
struct MapSummary {
  std::size_t voxels = 0;  // all voxels of the map
  std::size_t evaluated = 0;
  std::size_t reaching_cutoff = 0;  // evaluated voxels with score >= graspability_threshold
  std::size_t graspable = 0;        // evaluated voxels that the map marks graspable
  // Evaluated voxels with SSV (occupied voxels in mask) < solid_voxel_threshold; nullopt: unknown.
  std::optional<std::size_t> below_solid_threshold;
  // Scores at summary_quantiles (nearest rank); empty if no voxel was evaluated.
  std::vector<double> scores;
  std::vector<double> solid_voxels;  // SSV at summary_quantiles; empty if unknown
  std::vector<ScoreBin> score_bins;  // areas are not set
};

struct MapSummaryOptions {
  double graspability_threshold = 0.8;
  std::optional<double> solid_voxel_threshold{};  // TSV, minimum of SSV; nullopt: unknown
};

// Summarizes a map; `voxels` must be voxel_map_of(map).
MapSummary summarize_map(const libmap::PointCloud& map, const VoxelMap& voxels,
                         const MapSummaryOptions& options = {});

// Returns the thresholds in the manifest of a map, or else the defaults.
MapSummaryOptions summary_options(const libmap::Manifest& manifest);

struct SummarizedMap {
  std::string name;
  libmap::Manifest manifest{};  // empty: the cells of parameters are empty
  double cutoff = 0.8;          // minimum score that predicts graspable
  MapSummary summary{};
  std::optional<ExpectedMapResult> expected{};
};

// Returns one row per map: name, parameters of the detection, counts, fractions, quantiles. If one
// of the maps has `expected`, also sensitivity and specificity of voxels and of regions with Wilson
// 95 % intervals, Youden's index and the area under the curve. Undefined values are empty cells.
libmap::Table summary_table(const std::vector<SummarizedMap>& maps);

// Returns one row per region of `expected` for each map that was evaluated against it.
libmap::Table region_table(const std::vector<SummarizedMap>& maps, const ExpectedMap& expected);

// Returns one row per map and score bin: map, score (middle of the bin), voxels, share of voxels.
libmap::Table histogram_table(const std::vector<SummarizedMap>& maps);

// Agreement of two maps of one cloud over the voxels that are evaluated in both.
struct MapPair {
  std::size_t first = 0;  // index in the list of maps
  std::size_t second = 0;
  VoxelMatching matching = VoxelMatching::lattice;
  std::size_t common = 0;     // corresponding voxels, evaluated or not
  ChangeSummary evaluated{};  // first is MAP, second is OTHER; areas are not set
};

// Compares maps scored from one cloud; `first_terrain_from_second_terrain` is the transform between
// the terrain frames. Throws like compare_maps.
MapPair compare_pair(const VoxelMap& first, const VoxelMap& second,
                     const libmap::Pose& first_terrain_from_second_terrain);

// Returns one row per pair: numbers of voxels that are graspable in both maps, one map or neither,
// accuracy, Cohen's kappa, and the differences of the scores (second - first).
libmap::Table pair_table(const std::vector<SummarizedMap>& maps, const std::vector<MapPair>& pairs);

}  // namespace libgtd
