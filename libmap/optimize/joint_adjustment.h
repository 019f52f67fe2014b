// Bundle adjustment with all that is unknown in one dense system: poses, motions, points and the
// parameters of cameras, the points eliminated. Private to libmap/optimize.
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
  std::vector<BundleObservation> observations;  // those of a point side by side
  std::vector<std::size_t> begin = {0};         // of each point's; one more than points
  double robust_scale = 3.0;                    // of Cauchy's loss
  std::vector<bool> fixed;                      // of each pose
  bool fix_cameras = false;
  bool moving = false;                // motions are unknown
  std::vector<Vector6d> motion_mean;  // their prior
  std::vector<Vector6d> motion_deviation;
  // Prior of the cameras' parameters: residuals a x - b.
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
  std::vector<Vector6d> motions;  // of each pose
  Eigen::VectorXd camera_params;  // of all cameras
  std::vector<Eigen::Vector3d> points;
};

// Half the sum of squares of steps (rigid_motion.h) of poses, each followed by its motion if that
// is unknown, then of the cameras' parameters.
struct JointSystem {
  Eigen::MatrixXd matrix;  // lower triangle
  Eigen::VectorXd rhs;     // minus the gradient

  // Of the blocks of two poses, row >= column.
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

// Levenberg-Marquardt; converged when the cost falls by less than `tolerance` of itself. The state
// never gets worse. The same for any number of threads.
LeastSquaresSummary adjust_jointly(const JointProblem& problem, JointState& state,
                                   int max_iterations, double tolerance);

// The normal equations at a state. Unknowns that nothing binds, and fixed poses, have a diagonal
// of 1.
JointSystem joint_system(const JointProblem& problem, const JointState& state);

}  // namespace libmap
