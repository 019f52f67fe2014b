// The force that a gripper holds at a voxel, predicted from the heights of the columns around it:
// method `calibrated`.
//
// The palm comes down upright on a column until it or an open finger meets ground. Each of 16
// fingers then follows its closing path until one of its places is in the ground. If that is the
// outer half of the distal link, its spines pull as FingerPulls says of the ground's fall there,
// and push as all of them bear. The column's capacity C is the largest pull away from the ground
// that these forces balance with their moments about horizontal axes, by its dual on a grid,
//   C = min over sides b and u of mean over azimuths a of f(a, 1 - u cos(a - b)),
// f(a, w) = w pull for w > 0, else -w push; lateral pulls bound it: C / sqrt(1 + (C / 0.55)^2).
//
// Means over the columns around the voxel, with normal weights of a standard deviation of a quarter
// of the finger's length (where the gripper comes to rest is not known better), give for each
// parameter set the share of trials with a force and the mean and spread of its logarithm, by 13
// coefficients that are fitted once to the virtual field test (closing_force.cc).
#pragma once

#include <vector>

#include "libgtd/gripper/closing_path.h"
#include "libgtd/score/tiling.h"

namespace libgtd {

// Number of columns around a voxel on which its force depends.
int closing_reach_voxels(const ClosingPath& path, double voxel_size_m);

// Forces at each voxel of `pivots` (positions in grid.voxels, ascending). A column's height is that
// of its highest voxel; up to three columns into a gap, the mean of the columns beside it. Forces
// depend on the voxels within the reach alone, not on other pivots or the number of threads.
std::vector<ForceEstimate> closing_forces(const VoxelGrid& grid, const ClosingPath& path,
                                          const std::vector<std::size_t>& pivots);

// Of the same pivots, for a mask of method `corrected`: the share of 16 azimuths in which the
// columns fall by more than min_fall_m from the circle of the closed spines toward that of the open
// fingers. Columns without ground are skipped. A shape that the closed spines cannot reach, such as
// a small ball on level ground, has the share 0.
std::vector<double> outward_shares(const VoxelGrid& grid, const GripperMask& mask,
                                   const std::vector<std::size_t>& pivots);

}  // namespace libgtd
