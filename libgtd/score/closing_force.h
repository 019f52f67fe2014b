// Predicts the force that a gripper holds at a voxel from the heights of the surrounding columns:
// method `calibrated`.
//
// The palm descends upright on a column until it or an open finger meets ground. Each of 16 fingers
// then follows its closing path until one of its positions is inside the ground. If this is the
// outer half of the distal link, its spines pull with the force of FingerPulls for the fall of the
// ground there, and all of them push. The capacity C of the column is the largest pull away from
// the ground that these forces balance, including moments about horizontal axes, computed by its
// dual on a grid,
//   C = min over sides b and u of mean over azimuths a of f(a, 1 - u cos(a - b)),
// f(a, w) = w pull for w > 0, else -w push; lateral pulls bound it: C / sqrt(1 + (C / 0.55)^2).
//
// The resting position of the gripper is uncertain. Capacities are therefore averaged over the
// columns around the voxel, with normal weights of a standard deviation of a quarter of the finger
// length. From these means, 13 coefficients fitted once to the virtual field test
// (closing_force.cc) give, for each parameter set, the fraction of trials with a force and the mean
// and spread of its logarithm.
#pragma once

#include <vector>

#include "libgtd/gripper/closing_path.h"
#include "libgtd/score/tiling.h"

namespace libgtd {

// Returns the number of columns around a voxel on which its force depends.
int closing_reach_voxels(const ClosingPath& path, double voxel_size_m);

// Returns the forces at the voxels `pivots` (ascending indices in grid.voxels), one per pivot. The
// height of a column is that of its highest voxel; up to three columns into a gap, it is the mean
// of the adjacent columns. Forces depend only on voxels within the reach, not on other pivots or
// the number of threads.
std::vector<ForceEstimate> closing_forces(const VoxelGrid& grid, const ClosingPath& path,
                                          const std::vector<std::size_t>& pivots);

// For a mask of method `corrected`, returns per pivot the fraction of 16 azimuths in which the
// columns fall by more than min_fall_m from the circle of the closed spines to that of the open
// fingers. Columns without ground are skipped. A shape that the closed spines cannot reach, such as
// a small ball on level ground, has the value 0.
std::vector<double> outward_shares(const VoxelGrid& grid, const GripperMask& mask,
                                   const std::vector<std::size_t>& pivots);

}  // namespace libgtd
