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

// Errors after the rigid alignment that fits positions and rotations best (Umeyama 1991, without
// scale; chordal distance of rotations). Their weights are estimated from their residuals. Paths
// wider than 0.5 m (root mean square distance from the longest axis) are aligned by positions
// alone. Poses are paired by node, or by time (within 20 ms) if nodes are unknown. Throws Error for
// fewer than 3 pairs.
AbsoluteTrajectoryError absolute_trajectory_error(const Trajectory& estimate,
                                                  const Trajectory& truth);

// Errors of the motion between poses that follow each other.
TrajectoryError relative_trajectory_error(const Trajectory& estimate, const Trajectory& truth);

}  // namespace libmap
