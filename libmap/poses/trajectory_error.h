// How far a trajectory lies from the truth (Sturm et al. 2012, "A benchmark for the evaluation of
// RGB-D SLAM systems").
#pragma once

#include <cstddef>

#include "libmap/core/pose_graph.h"
#include "libmap/core/result_table.h"

namespace libmap {

struct TrajectoryError {
  std::size_t poses = 0;  // compared
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double median_m = 0.0;
  double max_m = 0.0;
  double mean_rotation_deg = 0.0;
  double max_rotation_deg = 0.0;
};
void describe(ResultTable& table, const TrajectoryError& error);

struct AbsoluteTrajectoryError : TrajectoryError {
  Pose truth_from_estimate = Pose::Identity();  // the alignment that was used
};

// Positions after the rigid alignment that fits them best (Umeyama 1991, without scale), or, where
// they lie on a line, the one that fits the rotations best (their chordal mean); rotations
// after the same alignment. Poses are paired by node, or by time (within 20 ms) where nodes are not
// known. Throws Error if fewer than 3 pairs are there.
AbsoluteTrajectoryError absolute_trajectory_error(const Trajectory& estimate,
                                                  const Trajectory& truth);

// Errors of the motion between poses that follow each other.
TrajectoryError relative_trajectory_error(const Trajectory& estimate, const Trajectory& truth);

}  // namespace libmap
