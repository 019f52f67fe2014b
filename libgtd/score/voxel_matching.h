// Voxel matching (eq. 3-17, 3-18, listing A.6): counts the ground voxels around a pivot voxel that
// match the gripper mask.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/instruction_set.h"
#include "libmap/core/progress.h"

namespace libgtd {

// Numbers of occupied terrain voxels in the window of the mask around a pivot.
struct VoxelCounts {
  std::uint32_t ssv = 0;  // occupied voxels that GripperMask::counted selects
  std::uint32_t gsv = 0;  // voxels of ssv that are solid in the mask
  bool operator==(const VoxelCounts&) const = default;
};

// Returns the pivots (voxels to be scored) of `grid` in `tile` as ascending indices in grid.voxels.
// Method corrected: all. Other methods exclude a border of half a mask: with h = mask.pivot_xy and
// NX columns along i, pivots have h+1 <= i <= NX-h-2 (i from the first column); j likewise.
std::vector<std::size_t> pivots_in(const VoxelGrid& grid, const GripperMask& mask,
                                   const TileBounds& tile);

// Returns the counts of each pivot. Terrain around a block of pivots is stored as bits; popcount
// counts matches, in parallel. The counts do not depend on the other pivots, the number of threads
// or `instructions`, which the processor must support. Memory is proportional to the number of
// voxels and the size of the mask, not to the bounding box.
std::vector<VoxelCounts> match_voxels(
    const VoxelGrid& grid, const GripperMask& mask, const std::vector<std::size_t>& pivots,
    libmap::InstructionSet instructions = libmap::best_instruction_set(),
    libmap::Progress& progress = libmap::no_progress());

// Returns the number of 64-byte chunks of the mask that are compared at each pivot.
std::size_t solid_chunks(const GripperMask& mask);

// Returns the score in percent (eq. 3-17, 3-18) with TSV = `solid_voxel_threshold`; 0 if SSV is 0:
// - q = 100 GSV / SSV. climblab: the score is q.
// - Others: if SSV <= TSV and q >= 60, the score is q - 100 (TSV - SSV) / TSV, else q.
// - thesis, envelope: q has single precision as in the author's program (which then truncates the
//   score to an integer); the score can be negative.
// - corrected: q has double precision, and the score is at least 0.
double score_percent(const VoxelCounts& counts, Method method, int solid_voxel_threshold);

// Returns true if a voxel is graspable by the counts: the score (0..1) is >= the threshold or, with
// `climblab`, all counted occupied voxels are solid in the mask (gsv = ssv) and ssv exceeds TSV.
bool meets_threshold(const VoxelCounts& counts, double score, Method method,
                     int solid_voxel_threshold, double graspability_threshold);

}  // namespace libgtd
