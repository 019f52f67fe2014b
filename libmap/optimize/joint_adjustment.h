// Bundle adjustment with free camera parameters: one dense system of poses, motions and camera
// parameters, from which points are eliminated. Private to libmap/optimize.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "libmap/optimize/bundle_points.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

struct JointProblem {
  std::vector<BundleObservation> observations;  // grouped by point
  std::vector<std::size_t> begin = {0};         // first observation by point; one more than points
  double robust_scale = 3.0;                    // width of Cauchy's loss, standard deviations
  std::vector<bool> fixed;                      // by pose
  bool fix_cameras = false;
  bool has_motion = false;            // true: motions are unknown
  std::vector<Vector6d> motion_mean;  // prior of the motions
  std::vector<Vector6d> motion_deviation;
  // Prior of the camera parameters x: residuals prior x - prior_mean.
  Eigen::MatrixXd prior;
  Eigen::VectorXd prior_mean;
  std::vector<GraphLinkResult> links;

  std::size_t points() const { return begin.size() - 1; }
  std::span<const BundleObservation> observations_of(std::size_t point) const {
    return {observations.data() + begin[point], begin[point + 1] - begin[point]};
  }
};

struct JointState {
  std::map<int, Pose> poses;
  std::vector<Vector6d> motions;  // by pose, base frame, m/s and rad/s
  Eigen::VectorXd camera_params;  // of all cameras
  std::vector<Eigen::Vector3d> points;
};

// Normal equations. The unknowns are steps (rigid_motion.h) of poses, each followed by the pose's
// motion if motions are unknown, then the camera parameters.
struct JointSystem {
  Eigen::MatrixXd matrix;  // lower triangle
  Eigen::VectorXd rhs;     // negative gradient

  // Adds to the block of two poses, row >= column.
  template <typename Block>
  void add(std::size_t row, std::size_t column, const Block& block) {
    constexpr int size = Block::RowsAtCompileTime;
    matrix
        .block<size, size>(size * static_cast<Eigen::Index>(row),
                           size * static_cast<Eigen::Index>(column))
        .noalias() += block;
  }
  template <typename Vector>
  void add_rhs(std::size_t row, const Vector& vector) {
    constexpr int size = Vector::RowsAtCompileTime;
    rhs.segment<size>(size * static_cast<Eigen::Index>(row)).noalias() += vector;
  }
};

// Levenberg-Marquardt. Converges when a step reduces the cost by less than the share `tolerance`.
// The cost of the state never increases. The result does not depend on the number of threads.
LeastSquaresSummary adjust_jointly(const JointProblem& problem, JointState& state,
                                   int max_iterations, double tolerance);

// Normal equations at a state. Fixed poses and unconstrained unknowns have a diagonal of 1.
JointSystem joint_system(const JointProblem& problem, const JointState& state);

}  // namespace libmap
