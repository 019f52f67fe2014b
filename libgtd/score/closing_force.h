// Predicts the force that a gripper can hold at each voxel from the heights of the surrounding
// voxel columns, for the scoring method `calibrated`.
#pragma once

#include <vector>

#include "libgtd/gripper/closing_path.h"
#include "libgtd/score/tiling.h"

namespace libgtd {

// Returns the maximum distance, in columns, of voxels that affect the force at a voxel.
int closing_reach_voxels(const ClosingPath& path, double voxel_size_m);

// Returns the forces at the voxels `pivots` (ascending indices in grid.voxels), one per pivot. The
// height of a column is that of its highest voxel; up to three columns into a gap, it is the mean
// height of the adjacent columns. Forces depend only on voxels within closing_reach_voxels(), not
// on other pivots or the number of threads.
std::vector<ForceEstimate> closing_forces(const VoxelGrid& grid, const ClosingPath& path,
                                          const std::vector<std::size_t>& pivots);

// For a mask of method `corrected`, returns per pivot the fraction of 16 azimuths in which the
// ground falls by more than min_fall_m from the circle of the closed spines to the circle of the
// open fingers. Columns without ground are skipped. A small ball on level ground, for example, has
// the value 0: the closed spines cannot reach it.
std::vector<double> outward_fall_fractions(const VoxelGrid& grid, const GripperMask& mask,
                                           const std::vector<std::size_t>& pivots);

}  // namespace libgtd
