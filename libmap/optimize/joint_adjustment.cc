#include "libmap/optimize/joint_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/optimize/graph_links.h"

namespace libmap {

namespace {

constexpr std::size_t parts = 4;  // parts of the points; the system of each part is in memory
constexpr std::size_t points_per_task = 500;
constexpr int first_point_iterations = 2;  // before the first step of poses and cameras

// Products a b^T and a b, column by column: faster than Eigen's general product for this size.
template <typename Left, typename Right, typename Block>
void subtract_product(const Left& a, const Right& b, Block&& from) {
  for (Eigen::Index n = 0; n < b.rows(); ++n)
    from.col(n) -= a.col(0) * b(n, 0) + a.col(1) * b(n, 1) + a.col(2) * b(n, 2);
}
template <typename Left, typename Right, typename Block>
void add_product(const Left& a, const Right& b, Block&& to) {
  for (Eigen::Index n = 0; n < b.cols(); ++n)
    to.col(n) += a.col(0) * b(0, n) + a.col(1) * b(1, n) + a.col(2) * b(2, n);
}

// Schur complement with the camera parameters, which border the system.
template <int node_size>
class CameraPointSchur : public PointSchur<node_size, JointSystem> {
 public:
  using Base = PointSchur<node_size, JointSystem>;

  // `first` to `end`: free camera parameters
  CameraPointSchur(Eigen::Index cameras_at, Eigen::Index first, Eigen::Index end)
      : cameras_(cameras_at),
        first_(first),
        end_(end),
        mixed_params_(MixedParams::Zero(std::max<Eigen::Index>(end - first, 0), 3)) {}

  void add(const BundleObservation& observation, const CalibratedResidual& seen, double weight,
           JointSystem& system) {
    Base::add(observation, seen, weight, system);
    if (first_ < end_) add_camera(observation, seen, weight, system);
  }
  void eliminate(JointSystem& system) {
    Base::eliminate(system);
    if (first_ >= end_ || this->views_.empty()) return;
    const Eigen::Index at = cameras_ + first_;
    const Eigen::Index count = end_ - first_;
    for (const auto& view : this->views_)
      subtract_product(mixed_params_, view.reduced,
                       system.matrix.block(at, row_of(view.node), count, node_size));
    system.rhs.segment(at, count).noalias() -= mixed_params_ * this->step_;
    const MixedParams reduced = mixed_params_.lazyProduct(this->inverse_);
    subtract_product(mixed_params_, reduced, system.matrix.block(at, at, count, count));
  }

 private:
  using MixedParams = Eigen::Matrix<double, Eigen::Dynamic, 3>;

  static Eigen::Index row_of(std::size_t node) {
    return node_size * static_cast<Eigen::Index>(node);
  }
  void add_camera(const BundleObservation& observation, const CalibratedResidual& seen,
                  double weight, JointSystem& system);

  Eigen::Index cameras_;
  Eigen::Index first_;
  Eigen::Index end_;
  MixedParams mixed_params_;  // second derivatives by free parameters and point
};

template <int node_size>
void CameraPointSchur<node_size>::add_camera(const BundleObservation& observation,
                                             const CalibratedResidual& seen, double weight,
                                             JointSystem& system) {
  const typename Base::ByNode by_node = Base::by_node(seen);
  const Eigen::Index row = row_of(observation.node);
  Eigen::MatrixXd& matrix = system.matrix;
  const Eigen::Index first = std::max(first_, observation.first_param);
  const Eigen::Index count = std::min(end_, observation.first_param + spline_at) - first;
  if (count <= 0) return;
  const auto by_camera = seen.by_camera.middleCols(first - observation.first_param, count);
  const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, spline_at, 3> camera =
      weight * by_camera.transpose();
  const Eigen::Index at = cameras_ + first;
  add_product(camera, by_node, matrix.block(at, row, count, node_size));
  add_product(camera, by_camera, matrix.block(at, at, count, count));
  system.rhs.segment(at, count).noalias() -= camera * seen.residual;
  add_product(camera, seen.by_point, mixed_params_.middleRows(first - first_, count));
  const CalibratedObservation& calibrated = observation.feature.calibrated();
  if (!calibrated.depth) return;
  const Eigen::Index spline =
      observation.first_param + spline_at + static_cast<Eigen::Index>(calibrated.terms.first);
  const Eigen::Vector4d depth = weight * seen.depth_by_spline.transpose();
  matrix.template block<4, node_size>(cameras_ + spline, row).noalias() += depth * by_node.row(2);
  matrix.block(cameras_ + spline, at, 4, count).noalias() += depth * by_camera.row(2);
  matrix.template block<4, 4>(cameras_ + spline, cameras_ + spline).noalias() +=
      depth * seen.depth_by_spline;
  system.rhs.template segment<4>(cameras_ + spline) -= depth * seen.residual.z();
  mixed_params_.template middleRows<4>(spline - first_).noalias() += depth * seen.by_point.row(2);
}

// Problem for levenberg_marquardt.
class JointSolver {
 public:
  JointSolver(const JointProblem& problem, JointState state)
      : problem_(problem),
        node_size_(problem.has_motion ? 12 : 6),
        cameras_at_(node_size_ * static_cast<Eigen::Index>(state.poses.size())),
        params_(state.camera_params.size()),
        state_(std::move(state)) {}

  void optimize_points(JointState& state, int point_iterations) const;
  double cost(const JointState& state) const;
  void linearize();
  double propose(double damping);
  void accept() { state_ = std::move(proposed_); }

  JointState& state() { return state_; }
  JointSystem& system() { return system_; }

 private:
  BundleView view_of(const JointState& state) const {
    BundleView view(state.poses);
    if (problem_.has_motion) view.motions = &state.motions;
    view.camera_params = state.camera_params.data();
    return view;
  }
  template <int node_size>
  void add_point(const BundleView& view, std::size_t point, JointSystem& system) const;
  void add_priors();
  void add_links();
  void fix();
  JointState stepped(const Eigen::VectorXd& step) const;

  const JointProblem& problem_;
  Eigen::Index node_size_;
  Eigen::Index cameras_at_;
  Eigen::Index params_;
  JointState state_;
  JointState proposed_;
  JointSystem system_;
};

double JointSolver::cost(const JointState& state) const {
  const BundleView view = view_of(state);
  double cost = parallel_reduce(
      problem_.points(), points_per_task, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        CalibratedResidual seen;
        for (std::size_t point = begin; point < end; ++point)
          for (const BundleObservation& observation : problem_.observations_of(point))
            sum += view.cost(observation, state.points[point], problem_.robust_scale, seen);
        return sum;
      },
      [](double a, double b) { return a + b; });
  cost += 0.5 * (problem_.prior * state.camera_params - problem_.prior_mean).squaredNorm();
  if (problem_.has_motion)
    for (std::size_t n = 0; n < state.motions.size(); ++n)
      cost += 0.5 * (state.motions[n] - problem_.motion_mean[n])
                        .cwiseQuotient(problem_.motion_deviation[n])
                        .squaredNorm();
  return cost + link_cost(state.poses, problem_.links);
}

template <int node_size>
void JointSolver::add_point(const BundleView& view, std::size_t point, JointSystem& system) const {
  CameraPointSchur<node_size> schur(
      cameras_at_, problem_.first_param,
      problem_.fix_cameras ? 0 : std::min(problem_.end_param, params_));
  CalibratedResidual seen;
  for (const BundleObservation& observation : problem_.observations_of(point))
    if (view.evaluate(observation, state_.points[point], seen, true))
      schur.add(observation, seen, robust_weight(seen.residual, problem_.robust_scale), system);
  schur.eliminate(system);
}

void JointSolver::add_priors() {
  system_.matrix.bottomRightCorner(params_, params_) += problem_.prior.transpose() * problem_.prior;
  system_.rhs.tail(params_) -=
      problem_.prior.transpose() * (problem_.prior * state_.camera_params - problem_.prior_mean);
  if (!problem_.has_motion) return;
  for (std::size_t n = 0; n < state_.motions.size(); ++n) {
    const Vector6d weight = problem_.motion_deviation[n].array().square().inverse();
    const Eigen::Index row = node_size_ * static_cast<Eigen::Index>(n) + 6;
    system_.matrix.diagonal().segment<6>(row) += weight;
    system_.rhs.segment<6>(row) -= weight.cwiseProduct(state_.motions[n] - problem_.motion_mean[n]);
  }
}

void JointSolver::add_links() {
  const auto at = [&](std::size_t node) { return node_size_ * static_cast<Eigen::Index>(node); };
  const BlockSystem links = all_link_system(state_.poses, problem_.links);
  for (const auto& [key, block] : links.blocks())
    system_.matrix.block<6, 6>(at(key.second), at(key.first)) += block.transpose();
  for (std::size_t n = 0; n < links.rhs().size(); ++n)
    system_.rhs.segment<6>(at(n)) += links.rhs()[n];
}

void JointSolver::fix() {
  const auto fix_rows = [&](Eigen::Index row, Eigen::Index rows) {
    system_.matrix.middleRows(row, rows).setZero();
    system_.matrix.middleCols(row, rows).setZero();
    system_.rhs.segment(row, rows).setZero();
  };
  for (std::size_t n = 0; n < state_.poses.size(); ++n)
    if (problem_.fixed[n]) fix_rows(node_size_ * static_cast<Eigen::Index>(n), 6);
  if (problem_.fix_cameras) fix_rows(cameras_at_, params_);
  for (Eigen::Index n = 0; n < system_.matrix.rows(); ++n)
    if (!(system_.matrix(n, n) > 0.0)) system_.matrix(n, n) = 1.0;
}

void JointSolver::linearize() {
  const BundleView view = view_of(state_);
  const Eigen::Index size = cameras_at_ + params_;
  std::vector<JointSystem> partial_systems(
      parts, {Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)});
  parallel_each(parts, [&](std::size_t part) {
    const std::size_t end = (part + 1) * problem_.points() / parts;
    for (std::size_t point = part * problem_.points() / parts; point < end; ++point) {
      if (problem_.has_motion)
        add_point<12>(view, point, partial_systems[part]);
      else
        add_point<6>(view, point, partial_systems[part]);
    }
  });
  system_ = std::move(partial_systems[0]);
  for (std::size_t part = 1; part < parts; ++part) {
    system_.matrix += partial_systems[part].matrix;
    system_.rhs += partial_systems[part].rhs;
  }
  add_priors();
  add_links();
  fix();
}

void JointSolver::optimize_points(JointState& state, int point_iterations) const {
  const BundleView view = view_of(state);
  parallel_each(problem_.points(), points_per_task, [&](std::size_t point) {
    optimize_point(problem_.observations_of(point), view, problem_.robust_scale, point_iterations,
                   state.points[point]);
  });
}

JointState JointSolver::stepped(const Eigen::VectorXd& step) const {
  JointState after = state_;
  std::size_t node_index = 0;
  for (auto& [node, pose] : after.poses) {
    const Eigen::Index row = node_size_ * static_cast<Eigen::Index>(node_index);
    if (!problem_.fixed[node_index]) pose = moved(pose, step.segment<6>(row));
    if (problem_.has_motion) after.motions[node_index] += step.segment<6>(row + 6);
    ++node_index;
  }
  after.camera_params += step.tail(params_);
  optimize_points(after, 1);
  return after;
}

double JointSolver::propose(double damping) {
  Eigen::MatrixXd damped = system_.matrix;
  damped.diagonal() *= 1.0 + damping;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> root(damped);
  if (root.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  proposed_ = stepped(root.solve(system_.rhs));
  return cost(proposed_);
}

}  // namespace

JointSystem joint_system(const JointProblem& problem, const JointState& state) {
  JointSolver solver(problem, state);
  solver.linearize();
  return std::move(solver.system());
}

LeastSquaresSummary adjust_jointly(const JointProblem& problem, JointState& state,
                                   int max_iterations, double tolerance) {
  JointSolver solver(problem, state);
  const double initial_cost = solver.cost(state);
  double cost = initial_cost;
  JointState start = state;
  solver.optimize_points(start, first_point_iterations);
  if (const double start_cost = solver.cost(start); start_cost < cost) {
    solver.state() = std::move(start);
    cost = start_cost;
  }
  LeastSquaresSummary summary =
      levenberg_marquardt(solver, cost, {.max_iterations = max_iterations, .tolerance = tolerance});
  summary.initial_cost = initial_cost;
  state = std::move(solver.state());
  return summary;
}

}  // namespace libmap
