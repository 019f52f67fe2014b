// Voxel matching (eq. 3-17, 3-18, listing A.6): how much of the ground around a pivot voxel lies
// where the gripper mask wants it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/instruction_set.h"
#include "libmap/core/progress.h"

namespace libgtd {

// Sum of V * O and of V * M * O over the window of a pivot.
struct VoxelCounts {
  std::uint32_t ssv = 0;  // solid voxels in the sub-space
  std::uint32_t gsv = 0;  // those of them that the mask wants
  bool operator==(const VoxelCounts&) const = default;
};

// The pivots of `grid` within `tile`, as positions in grid.voxels, ascending. Methods other than
// `corrected` pass over a border of half a mask: h+1 <= i <= NX-h-2 and the same in j.
std::vector<std::size_t> pivots_in(const VoxelGrid& grid, const GripperMask& mask,
                                   const TileBounds& tile);

// Counts of each pivot, by population counts over bits of the terrain around blocks of pivots.
// Blocks run in parallel; the counts of a pivot do not depend on which others are asked for, on the
// number of threads or on `instructions`, which the processor must have. Memory goes with the
// number of voxels and the size of the mask, not with the box around them.
std::vector<VoxelCounts> match_voxels(
    const VoxelGrid& grid, const GripperMask& mask, const std::vector<std::size_t>& pivots,
    libmap::InstructionSet instructions = libmap::best_instruction_set(),
    libmap::Progress& progress = libmap::no_progress());

// Number of chunks of 64 bytes of the mask that are compared with the ground at each pivot.
std::size_t solid_chunks(const GripperMask& mask);

// Percent (eq. 3-17, 3-18): GSV / SSV, lowered by (TSV - SSV) / TSV * 100 where SSV <= TSV and the
// quotient is at least 60. `thesis` and `envelope` divide in single precision as the author's
// program does (which then cuts the result to an integer) and can be negative; `corrected` divides
// in double precision and ends at 0. `climblab` has no penalty.
double score_percent(const VoxelCounts& counts, Method method, int solid_voxel_threshold);

// Whether the counts alone make a voxel graspable: its score (0..1) reaches the threshold, or, with
// `climblab`, every solid voxel of the window lies in the mask and there are more than TSV of them.
bool meets_threshold(const VoxelCounts& counts, double score, Method method,
                     int solid_voxel_threshold, double graspability_threshold);

}  // namespace libgtd
