// Maps in one line each: what was asked of the detection, how its scores spread, and how well it
// does where expectations are known.
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

// Of the evaluated voxels (VoxelMap::evaluated): above the zero plane, and with all of the mask's
// window in the scanned area.
struct MapSummary {
  std::size_t voxels = 0;  // of the whole map
  std::size_t evaluated = 0;
  std::size_t reached = 0;    // with a score that reaches the threshold
  std::size_t graspable = 0;  // with the map's flag
  // With fewer solid voxels than the threshold TSV: no other score depends on it. Nothing where
  // TSV or SSV is not known.
  std::optional<std::size_t> few_solid;
  // By nearest rank, at summary_quantiles; empty where nothing was evaluated.
  std::vector<double> scores;
  std::vector<double> solid_voxels;  // SSV; empty too where it is not known
  std::vector<ScoreBin> score_bins;  // without areas
};

struct MapSummaryOptions {
  double graspability_threshold = 0.8;
  std::optional<double> solid_voxel_threshold{};
};

// `voxels` is voxel_map_of(map).
MapSummary summarize_map(const libmap::PointCloud& map, const VoxelMap& voxels,
                         const MapSummaryOptions& options = {});

// Both thresholds as the manifest of a map names them, where it does.
MapSummaryOptions summary_options(const libmap::Manifest& manifest);

struct SummarizedMap {
  std::string name;
  libmap::Manifest manifest{};  // empty: its parameters are empty cells
  double cutoff = 0.8;
  MapSummary summary{};
  std::optional<ExpectedMapResult> expected{};
};

// One row per map: name, parameters of the detection, counts, shares, quantiles; if one of them has
// an expectation also sensitivity and specificity, of voxels and of places, with Wilson 95 %
// intervals, Youden's index and the area under the curve. Undefined values are empty cells.
libmap::Table summary_table(const std::vector<SummarizedMap>& maps);

// One row per map and region of `expected`.
libmap::Table region_table(const std::vector<SummarizedMap>& maps, const ExpectedMap& expected);

// Columns map, score (the middle of a bin), voxels, share (of the evaluated).
libmap::Table histogram_table(const std::vector<SummarizedMap>& maps);

// How two maps of one cloud agree, over the voxels that are evaluated in both.
struct MapPair {
  std::size_t first = 0;  // of the list of maps
  std::size_t second = 0;
  VoxelMatching matching = VoxelMatching::lattice;
  std::size_t common = 0;     // voxels of one place, evaluated or not
  ChangeSummary evaluated{};  // the first is MAP, the second OTHER; without areas
};

// Of maps scored from one cloud, `first_terrain_from_second_terrain` between their frames. Throws
// Error as compare_maps does.
MapPair compare_pair(const VoxelMap& first, const VoxelMap& second,
                     const libmap::Pose& first_terrain_from_second_terrain);

// One row a pair: how many voxels both, one of them or none says can be held, accuracy, Cohen's
// kappa, and the differences of the scores (the second's less the first's).
libmap::Table pair_table(const std::vector<SummarizedMap>& maps, const std::vector<MapPair>& pairs);

}  // namespace libgtd
