// Adjusts poses, velocities (`motions`) and camera parameters in one dense system. Points are
// optimized at given poses and cameras and eliminated from the normal equations (Schur complement).
// Private to libmap/optimize.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/features/bundle_residuals.h"
#include "libmap/geometry/least_squares.h"
#include "libmap/geometry/robust.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

struct BundleObservation {
  std::size_t node = 0;          // index of the pose in JointState::poses
  Eigen::Index first_param = 0;  // index of the camera's first parameter
  CalibratedFeature feature;
};

// Returns the weight of a residual for Cauchy's loss of width `scale`.
inline double robust_weight(const Eigen::Vector3d& residual, double scale) {
  return cauchy_weight(residual.squaredNorm() / (scale * scale));
}

// Poses, motions and cameras at which observations are evaluated; does not own the data.
struct BundleView {
  std::vector<const Pose*> poses;                  // by index of the pose
  const std::vector<Vector6d>* motions = nullptr;  // by index of the pose; nullptr: no motion
  const double* camera_params = nullptr;           // parameters of all cameras

  explicit BundleView(const std::map<int, Pose>& map_from_base) {
    for (const auto& [node, pose] : map_from_base) poses.push_back(&pose);
  }
  bool evaluate(const BundleObservation& seen, const Eigen::Vector3d& point,
                CalibratedResidual& result, bool with_derivatives) const {
    return seen.feature.evaluate(*poses[seen.node],
                                 motions != nullptr ? (*motions)[seen.node] : Vector6d::Zero(),
                                 camera_params + seen.first_param, point, result, with_derivatives);
  }
  // Returns Cauchy's loss; very large if the point is not in front of the camera.
  double cost(const BundleObservation& seen, const Eigen::Vector3d& point, double robust_scale,
              CalibratedResidual& result) const {
    constexpr double behind = 1e6;
    if (!evaluate(seen, point, result, false)) result.residual.setConstant(behind);
    const double square = robust_scale * robust_scale;
    return 0.5 * square * std::log1p(result.residual.squaredNorm() / square);
  }
};

// Optimizes the position of one point (map frame) by Gauss-Newton.
inline void optimize_point(std::span<const BundleObservation> observations, const BundleView& view,
                           double robust_scale, int point_iterations, Eigen::Vector3d& point) {
  gauss_newton(point_iterations, [&] {
    NormalEquations<3> equations;
    CalibratedResidual seen;
    for (const BundleObservation& observation : observations)
      if (view.evaluate(observation, point, seen, true))
        equations.add(seen.by_point, seen.residual, robust_weight(seen.residual, robust_scale));
    const Eigen::Vector3d step = equations.matrix.ldlt().solve(equations.rhs);
    if (!step.allFinite()) return StepState::failed;
    point += step;
    return StepState::moving;
  });
}

// Collects the observations of one point and eliminates the point. `System` provides
//   add(row, column, block)  for two nodes, row >= column
//   add_rhs(row, vector)
template <int node_size, typename System>
class PointSchur {
 public:
  using ByNode = Eigen::Matrix<double, 3, node_size>;
  using Mixed = Eigen::Matrix<double, node_size, 3>;

  static ByNode by_node(const CalibratedResidual& seen) {
    ByNode by_node;
    by_node.template leftCols<6>() = seen.by_pose;
    if constexpr (node_size == 12) by_node.template rightCols<6>() = seen.by_motion;
    return by_node;
  }

  // Adds the observation's terms without the point. Observations must be added by ascending node.
  void add(const BundleObservation& observation, const CalibratedResidual& seen, double weight,
           System& system) {
    const ByNode jacobian = by_node(seen);
    const Mixed weighted = weight * jacobian.transpose();
    system.add(observation.node, observation.node, weighted.lazyProduct(jacobian));
    system.add_rhs(observation.node, -weighted * seen.residual);
    views_.push_back({observation.node, weighted * seen.by_point, Mixed::Zero()});
    const Eigen::Matrix3d weighted_point = weight * seen.by_point.transpose();
    hessian_.noalias() += weighted_point * seen.by_point;
    rhs_.noalias() -= weighted_point * seen.residual;
  }

  // Eliminates the point. Lazy products, because Eigen's general product copies its factors first.
  void eliminate(System& system) {
    if (views_.empty()) return;
    inverse_ = hessian_.inverse();
    step_ = inverse_ * rhs_;
    for (std::size_t a = 0; a < views_.size(); ++a) {
      View& view = views_[a];
      view.reduced = view.mixed * inverse_;
      system.add_rhs(view.node, -view.mixed * step_);
      for (std::size_t b = 0; b <= a; ++b)
        system.add(view.node, views_[b].node,
                   -view.reduced.lazyProduct(views_[b].mixed.transpose()));
    }
  }

 protected:
  struct View {
    std::size_t node;
    Mixed mixed;    // second derivatives by node and point
    Mixed reduced;  // mixed times the inverse Hessian of the point
  };
  std::vector<View> views_;
  Eigen::Matrix3d hessian_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inverse_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d step_ = Eigen::Vector3d::Zero();
};

struct JointProblem {
  std::vector<BundleObservation> observations;  // grouped by point
  std::vector<std::size_t> begin = {0};         // index of each point's first observation, and end
  double robust_scale = 3.0;                    // width of Cauchy's loss, standard deviations
  std::vector<bool> fixed;                      // by pose; true: the pose is constant
  bool fix_cameras = false;
  // Camera parameters before first_param and from end_param on have no influence on the residuals.
  Eigen::Index first_param = 0;
  Eigen::Index end_param = std::numeric_limits<Eigen::Index>::max();
  bool has_motion = false;            // true: motions are unknown
  std::vector<Vector6d> motion_mean;  // prior of the motions, by pose
  std::vector<Vector6d> motion_deviation;
  // Prior of the camera parameters x, with the residuals prior * x - prior_mean.
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
  Eigen::VectorXd camera_params;  // parameters of all cameras
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

// Optimizes by Levenberg-Marquardt. Converges when a step reduces the cost by less than the
// fraction `tolerance`. The cost of the state never increases.
LeastSquaresSummary adjust_jointly(const JointProblem& problem, JointState& state,
                                   int max_iterations, double tolerance);

// Returns the normal equations at a state, with diagonal 1 for fixed and unconstrained unknowns.
JointSystem joint_system(const JointProblem& problem, const JointState& state);

}  // namespace libmap
