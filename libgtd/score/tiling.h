// Scores the voxels of a terrain with an upright gripper mask, tile by tile. The scores of a tile
// depend on the voxels of the tile and of a margin around it, but not on the tile size, the order
// of the tiles or the number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/score/scanned_area.h"
#include "libgtd/score/voxel_matching.h"
#include "libmap/core/progress.h"

namespace libgtd {

// Returns the tiles that cover the box of the grid, ascending by i, then j. Borders between tiles
// are at multiples of `tile_voxels` for any cloud. Throws Error for more than 2^24 tiles.
std::vector<TileBounds> make_tiles(const VoxelGrid& grid, int tile_voxels);

// Distribution of the holding force (weakest direction) at a voxel over trials and parameter sets.
struct ForceEstimate {
  float median_n = 0.0F;
  float low_n = 0.0F;             // quantile 0.05
  float high_n = 0.0F;            // quantile 0.95
  float hold_probability = 0.0F;  // probability that the force reaches the load
  float trial_spread = 0.0F;      // standard deviation of ln(force) between trials of one set
  float parameter_spread = 0.0F;  // standard deviation of ln(force) between the sets
};

struct ScoredVoxel {
  Voxel voxel;
  VoxelCounts counts;
  double score = 0.0;                  // calibrated: hold_probability; others:
                                       // score_percent / 100 * outward_fall_fraction
  bool border = false;                 // the window of the mask leaves the scanned area
  ForceEstimate force{};               // calibrated only
  double outward_fall_fraction = 1.0;  // corrected only, see outward_fall_fractions
};

struct ScoringOptions {
  int solid_voxel_threshold = 120;                                       // TSV, see score_percent
  libmap::InstructionSet instructions = libmap::best_instruction_set();  // affects speed only
};

// Scores every pivot (pivots_in) of the tiles. Results ascend by voxel, each voxel once.
std::vector<ScoredVoxel> score_tiles(const VoxelGrid& grid, const GripperMask& mask,
                                     const std::vector<TileBounds>& tiles,
                                     const ScoringOptions& options,
                                     libmap::Progress& progress = libmap::no_progress());

// Returns 1 for pivots with a mask window that contains a column outside the scanned area, else 0.
std::vector<std::uint8_t> find_border_pivots(const VoxelGrid& grid, const GripperMask& mask,
                                             const TileBounds& tile,
                                             const std::vector<std::size_t>& pivots);

}  // namespace libgtd
