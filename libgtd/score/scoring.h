// From counted voxels to a graspability score.
#pragma once

#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/score/voxel_matching.h"

namespace libgtd {

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
