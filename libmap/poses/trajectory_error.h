// Computes errors of a trajectory against ground truth (Sturm et al. 2012, "A benchmark for the
// evaluation of RGB-D SLAM systems").
#pragma once

#include <cstddef>

#include "libmap/core/pose_graph.h"
#include "libmap/core/result_table.h"

namespace libmap {

struct TrajectoryError {
  std::size_t poses = 0;  // number of compared poses; of motions for relative_trajectory_error
  double rmse_m = 0.0;    // root mean square error of the positions
  double mean_m = 0.0;    // mean position error
  double median_m = 0.0;
  double max_m = 0.0;
  double mean_rotation_deg = 0.0;  // mean angle of the rotation errors
  double max_rotation_deg = 0.0;
};
void describe(ResultTable& table, const TrajectoryError& error);

struct AbsoluteTrajectoryError : TrajectoryError {
  Pose truth_from_estimate = Pose::Identity();  // applied alignment
};

// Returns the errors after a least-squares rigid alignment of positions and rotations (Umeyama
// 1991, without scale; chordal distance of rotations). The relative weight of rotations is
// estimated from the residuals. If the RMS distance of the positions from their principal axis is
// >= 0.5 m, only positions are aligned. Poses are paired by node, or by time (within 20 ms) if a
// pose has no node; poses without a partner are ignored. Throws Error for fewer than 3 pairs.
AbsoluteTrajectoryError absolute_trajectory_error(const Trajectory& estimate,
                                                  const Trajectory& truth);

// Returns the errors of the motions between consecutive poses, which are paired as in
// absolute_trajectory_error. Throws Error for fewer than 2 pairs.
TrajectoryError relative_trajectory_error(const Trajectory& estimate, const Trajectory& truth);

}  // namespace libmap
