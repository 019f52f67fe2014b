// A terrain's voxels scored tile by tile. A tile reads its own voxels and a halo around them, and
// nothing that it yields depends on its size, its order or the number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/score/scanned_area.h"
#include "libgtd/score/voxel_matching.h"
#include "libmap/core/progress.h"

namespace libgtd {

// The tiles that cover the grid's box, in rows along j; borders within the box
// are whole multiples of `tile_voxels` on the lattice, whatever the cloud. Throws Error for more
// than 2^24 tiles.
std::vector<TileBounds> make_tiles(const VoxelGrid& grid, int tile_voxels);

// Distribution of the holding force in the weakest direction at a voxel, over trials and parameter
// sets.
struct ForceEstimate {
  float median_n = 0.0F;
  float low_n = 0.0F;  // quantiles 0.05 and 0.95
  float high_n = 0.0F;
  float hold_probability = 0.0F;  // that the force reaches the load
  float trial_spread = 0.0F;      // standard deviations of ln(force): between trials of one set,
  float parameter_spread = 0.0F;  // and between the sets
};

struct ScoredVoxel {
  Voxel voxel;
  VoxelCounts counts;
  double score = 0.0;          // score_percent / 100
  bool border = false;         // the mask's window leaves the scanned area
  ForceEstimate force{};       // of method calibrated
  double falling_share = 1.0;  // of method corrected, see outward_shares
};

struct ScoringOptions {
  int solid_voxel_threshold = 120;
  libmap::InstructionSet instructions = libmap::best_instruction_set();  // changes the time alone
};

// Every pivot of the tiles, ascending by voxel, each once.
std::vector<ScoredVoxel> score_tiles(const VoxelGrid& grid, const GripperMask& mask,
                                     const std::vector<TileBounds>& tiles,
                                     const ScoringOptions& options,
                                     libmap::Progress& progress = libmap::no_progress());

// For each pivot whether the window of the mask holds a column outside the scanned area.
std::vector<std::uint8_t> find_edges(const VoxelGrid& grid, const GripperMask& mask,
                                     const TileBounds& tile,
                                     const std::vector<std::size_t>& pivots);

}  // namespace libgtd
