// What a closing gripper would meet at a voxel, from the heights of the columns around it: the
// terms of method `calibrated` (ClosingTerms in libgtd/gripper/gripper.h).
//
// The palm comes down upright on a column until it or an open finger meets ground. Each
// of 16 fingers then follows its closing path until one of its places is in the ground. Where that
// is the outer half of the distal link, its spines bear as much as the ground's fall outward
// allows. A side's share is the mean over the azimuths weighted with the cosine to the side, if
// positive. A voxel's terms are the mean over the columns with ground around it, with normal
// weights of a standard deviation of a quarter of the finger's length, cut at twice of it: where
// the gripper comes to rest is not known better.
#pragma once

#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

// How many columns around a voxel its terms depend on.
int closing_reach_voxels(const ClosingPath& path, double voxel_size_m);

// Of each voxel of `pivots` (positions in grid.voxels, ascending). A column's height is that of its
// highest voxel; up to three columns into a gap, the mean of the columns beside it. Terms depend on
// the voxels within the reach alone, not on other pivots or the number of threads.
std::vector<ClosingTerms> closing_terms(const VoxelGrid& grid, const ClosingPath& path,
                                        const std::vector<std::size_t>& pivots);

// Of the same pivots, for a mask of method `corrected`: the share of 16 azimuths in which the
// columns fall by more than min_fall_m from the circle of the closed spines toward that of the open
// fingers. Columns without ground are skipped. A shape that the closed spines cannot reach, such as
// a small ball on level ground, has the share 0.
std::vector<double> outward_shares(const VoxelGrid& grid, const GripperMask& mask,
                                   const std::vector<std::size_t>& pivots);

}  // namespace libgtd
