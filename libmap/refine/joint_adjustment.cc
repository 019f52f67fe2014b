#include "libmap/refine/joint_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/refine/link_terms.h"

namespace libmap {

namespace {

constexpr std::size_t parts = 4;  // of the points, whose systems are in memory
constexpr std::size_t points_a_task = 500;
constexpr double first_damping = 1e-6;  // of the diagonal
constexpr double least_damping = 1e-9;
constexpr int max_rejected = 8;
constexpr int settling_steps = 2;
constexpr double cost_rounding = 1e-12;  // of a cost

// The poses of a state by their places.
std::vector<const Pose*> poses_of(const JointState& state) {
  std::vector<const Pose*> poses;
  for (const auto& [node, pose] : state.poses) poses.push_back(&pose);
  return poses;
}

double weight_of(const Eigen::Vector3d& residual, double scale) {
  return 1.0 / (1.0 + residual.squaredNorm() / (scale * scale));
}

// a b^T and a b, column by column: Eigen's general product costs more for so few numbers.
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

// What the observations of one point say, until it is eliminated.
template <int node_size>
class PointShare {
 public:
  PointShare(Eigen::Index cameras_at, Eigen::Index numbers)
      : cameras_(cameras_at),
        numbers_(numbers),
        mixed_numbers_(Eigen::Matrix<double, Eigen::Dynamic, 3>::Zero(numbers, 3)) {}

  // All of it that is not mixed with the point goes to the system.
  void add(const JointObservation& observation, const CalibratedResidual& seen, double weight,
           JointSystem& system);
  void eliminate(JointSystem& system) const;

 private:
  using ByNode = Eigen::Matrix<double, 3, node_size>;

  void add_camera(const JointObservation& observation, const CalibratedResidual& seen,
                  double weight, const ByNode& by_node, JointSystem& system);

  Eigen::Index cameras_;
  Eigen::Index numbers_;
  Eigen::Matrix3d of_point_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d side_ = Eigen::Vector3d::Zero();
  // With the point: of each pose that sees it, its row; of the cameras' numbers.
  std::vector<std::pair<Eigen::Index, Eigen::Matrix<double, node_size, 3>>> mixed_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> mixed_numbers_;
};

template <int node_size>
void PointShare<node_size>::add(const JointObservation& observation, const CalibratedResidual& seen,
                                double weight, JointSystem& system) {
  ByNode by_node;
  by_node.template leftCols<6>() = seen.by_pose;
  if constexpr (node_size == 12) by_node.template rightCols<6>() = seen.by_motion;
  const Eigen::Matrix<double, node_size, 3> weighted = weight * by_node.transpose();
  const Eigen::Index row = node_size * static_cast<Eigen::Index>(observation.node);
  system.matrix.template block<node_size, node_size>(row, row).noalias() += weighted * by_node;
  system.side.template segment<node_size>(row).noalias() -= weighted * seen.residual;
  mixed_.emplace_back(row, weighted * seen.by_point);
  const Eigen::Matrix3d weighted_point = weight * seen.by_point.transpose();
  of_point_.noalias() += weighted_point * seen.by_point;
  side_.noalias() -= weighted_point * seen.residual;
  if (numbers_ > 0) add_camera(observation, seen, weight, by_node, system);
}

template <int node_size>
void PointShare<node_size>::add_camera(const JointObservation& observation,
                                       const CalibratedResidual& seen, double weight,
                                       const ByNode& by_node, JointSystem& system) {
  const Eigen::Index first = cameras_ + observation.first;
  const Eigen::Index row = mixed_.back().first;
  Eigen::MatrixXd& matrix = system.matrix;
  const Eigen::Matrix<double, spline_at, 3> camera = weight * seen.by_camera.transpose();
  add_product(camera, by_node, matrix.template block<spline_at, node_size>(first, row));
  add_product(camera, seen.by_camera, matrix.template block<spline_at, spline_at>(first, first));
  system.side.template segment<spline_at>(first).noalias() -= camera * seen.residual;
  add_product(camera, seen.by_point,
              mixed_numbers_.template middleRows<spline_at>(observation.first));
  const CalibratedObservation& its = observation.feature.calibrated();
  if (!its.depth) return;
  const Eigen::Index spline = spline_at + static_cast<Eigen::Index>(its.terms.first);
  const Eigen::Vector4d depth = weight * seen.depth_by_spline.transpose();
  matrix.template block<4, node_size>(first + spline, row).noalias() += depth * by_node.row(2);
  matrix.template block<4, spline_at>(first + spline, first).noalias() +=
      depth * seen.by_camera.row(2);
  matrix.template block<4, 4>(first + spline, first + spline).noalias() +=
      depth * seen.depth_by_spline;
  system.side.template segment<4>(first + spline) -= depth * seen.residual.z();
  mixed_numbers_.template middleRows<4>(observation.first + spline).noalias() +=
      depth * seen.by_point.row(2);
}

template <int node_size>
void PointShare<node_size>::eliminate(JointSystem& system) const {
  const Eigen::Matrix3d inverse = of_point_.inverse();
  const Eigen::Vector3d step = inverse * side_;
  for (std::size_t a = 0; a < mixed_.size(); ++a) {
    const auto& [row, mixed] = mixed_[a];
    const Eigen::Matrix<double, node_size, 3> reduced = mixed * inverse;
    system.side.template segment<node_size>(row).noalias() -= mixed * step;
    for (std::size_t b = 0; b <= a; ++b)  // by ascending pose: the lower triangle
      system.matrix.template block<node_size, node_size>(row, mixed_[b].first).noalias() -=
          reduced * mixed_[b].second.transpose();
    if (numbers_ > 0)
      subtract_product(mixed_numbers_, reduced,
                       system.matrix.block(cameras_, row, numbers_, node_size));
  }
  if (numbers_ == 0) return;
  system.side.tail(numbers_).noalias() -= mixed_numbers_ * step;
  const Eigen::Matrix<double, Eigen::Dynamic, 3> reduced = mixed_numbers_.lazyProduct(inverse);
  subtract_product(mixed_numbers_, reduced, system.matrix.bottomRightCorner(numbers_, numbers_));
}

class JointSolver {
 public:
  explicit JointSolver(const JointProblem& problem)
      : problem_(problem), node_size_(problem.moving ? 12 : 6) {}

  Eigen::Index size_of(const JointState& state) const {
    return cameras_at(state) + state.numbers.size();
  }
  double cost(const JointState& state) const;
  JointSystem system(const JointState& state) const;
  JointState stepped(const JointState& state, const Eigen::VectorXd& step) const;

 private:
  Eigen::Index cameras_at(const JointState& state) const {
    return node_size_ * static_cast<Eigen::Index>(state.poses.size());
  }
  bool linearize(const JointObservation& seen, const JointState& state,
                 const std::vector<const Pose*>& poses, std::size_t point,
                 CalibratedResidual& result, bool with_derivatives) const {
    return seen.feature.evaluate(
        *poses[seen.node], problem_.moving ? state.motions[seen.node] : Vector6d::Zero(),
        state.numbers.data() + seen.first, state.points[point], result, with_derivatives);
  }
  template <int node_size>
  void add_point(const JointState& state, const std::vector<const Pose*>& poses, std::size_t point,
                 JointSystem& system) const;
  void add_priors(const JointState& state, JointSystem& system) const;
  void add_links(const JointState& state, JointSystem& system) const;
  void hold(const JointState& state, JointSystem& system) const;

  const JointProblem& problem_;
  Eigen::Index node_size_;
};

// Infinite where a point is not in front of a camera that sees it.
double JointSolver::cost(const JointState& state) const {
  const std::vector<const Pose*> poses = poses_of(state);
  const double square = problem_.robust_scale * problem_.robust_scale;
  double cost = parallel_reduce(
      problem_.points(), points_a_task, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        CalibratedResidual seen;
        for (std::size_t point = begin; point < end; ++point)
          for (std::size_t n = problem_.begin[point]; n < problem_.begin[point + 1]; ++n)
            sum += linearize(problem_.observations[n], state, poses, point, seen, false)
                       ? 0.5 * square * std::log1p(seen.residual.squaredNorm() / square)
                       : std::numeric_limits<double>::infinity();
        return sum;
      },
      [](double a, double b) { return a + b; });
  cost += 0.5 * (problem_.prior * state.numbers - problem_.prior_mean).squaredNorm();
  if (problem_.moving)
    for (std::size_t n = 0; n < state.motions.size(); ++n)
      cost += 0.5 * (state.motions[n] - problem_.motion_mean[n])
                        .cwiseQuotient(problem_.motion_deviation[n])
                        .squaredNorm();
  return cost + link_cost(state.poses, problem_.links);
}

template <int node_size>
void JointSolver::add_point(const JointState& state, const std::vector<const Pose*>& poses,
                            std::size_t point, JointSystem& system) const {
  PointShare<node_size> share(cameras_at(state), state.numbers.size());
  CalibratedResidual seen;
  for (std::size_t n = problem_.begin[point]; n < problem_.begin[point + 1]; ++n) {
    linearize(problem_.observations[n], state, poses, point, seen, true);
    share.add(problem_.observations[n], seen, weight_of(seen.residual, problem_.robust_scale),
              system);
  }
  share.eliminate(system);
}

void JointSolver::add_priors(const JointState& state, JointSystem& system) const {
  const Eigen::Index numbers = state.numbers.size();
  system.matrix.bottomRightCorner(numbers, numbers) += problem_.prior.transpose() * problem_.prior;
  system.side.tail(numbers) -=
      problem_.prior.transpose() * (problem_.prior * state.numbers - problem_.prior_mean);
  if (!problem_.moving) return;
  for (std::size_t n = 0; n < state.motions.size(); ++n) {
    const Vector6d weight = problem_.motion_deviation[n].array().square().inverse();
    const Eigen::Index row = node_size_ * static_cast<Eigen::Index>(n) + 6;
    system.matrix.diagonal().segment<6>(row) += weight;
    system.side.segment<6>(row) -= weight.cwiseProduct(state.motions[n] - problem_.motion_mean[n]);
  }
}

void JointSolver::add_links(const JointState& state, JointSystem& system) const {
  const auto at = [&](std::size_t node) { return node_size_ * static_cast<Eigen::Index>(node); };
  const BlockSystem links = all_link_system(state.poses, problem_.links);
  for (const auto& [key, block] : links.blocks())
    system.matrix.block<6, 6>(at(key.second), at(key.first)) += block.transpose();
  for (std::size_t n = 0; n < links.side().size(); ++n)
    system.side.segment<6>(at(n)) += links.side()[n];
}

void JointSolver::hold(const JointState& state, JointSystem& system) const {
  const Eigen::Index size = system.matrix.rows();
  const auto hold_rows = [&](Eigen::Index row, Eigen::Index rows) {
    system.matrix.middleRows(row, rows).setZero();
    system.matrix.middleCols(row, rows).setZero();
    system.side.segment(row, rows).setZero();
  };
  for (std::size_t n = 0; n < state.poses.size(); ++n)
    if (problem_.held[n]) hold_rows(node_size_ * static_cast<Eigen::Index>(n), 6);
  if (problem_.numbers_held) hold_rows(cameras_at(state), state.numbers.size());
  for (Eigen::Index n = 0; n < size; ++n)
    if (!(system.matrix(n, n) > 0.0)) system.matrix(n, n) = 1.0;
}

JointSystem JointSolver::system(const JointState& state) const {
  const std::vector<const Pose*> poses = poses_of(state);
  const Eigen::Index size = size_of(state);
  const JointSystem empty{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  std::vector<JointSystem> shares(parts, empty);
  parallel_each(parts, [&](std::size_t part) {
    const std::size_t end = (part + 1) * problem_.points() / parts;
    for (std::size_t point = part * problem_.points() / parts; point < end; ++point) {
      if (problem_.moving)
        add_point<12>(state, poses, point, shares[part]);
      else
        add_point<6>(state, poses, point, shares[part]);
    }
  });
  JointSystem all = std::move(shares[0]);
  for (std::size_t part = 1; part < parts; ++part) {
    all.matrix += shares[part].matrix;
    all.side += shares[part].side;
  }
  add_priors(state, all);
  add_links(state, all);
  hold(state, all);
  return all;
}

// Each point follows by its own equations.
JointState JointSolver::stepped(const JointState& state, const Eigen::VectorXd& step) const {
  const std::vector<const Pose*> poses = poses_of(state);
  const Eigen::VectorXd cameras = step.tail(state.numbers.size());
  JointState after = state;
  std::size_t place = 0;
  for (auto& [node, pose] : after.poses) {
    const Eigen::Index row = node_size_ * static_cast<Eigen::Index>(place);
    if (!problem_.held[place]) pose = moved(pose, step.segment<6>(row));
    if (problem_.moving) after.motions[place] += step.segment<6>(row + 6);
    ++place;
  }
  after.numbers += cameras;
  parallel_for(problem_.points(), points_a_task, [&](std::size_t begin, std::size_t end) {
    CalibratedResidual seen;
    for (std::size_t point = begin; point < end; ++point) {
      Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
      Eigen::Vector3d side = Eigen::Vector3d::Zero();
      for (std::size_t n = problem_.begin[point]; n < problem_.begin[point + 1]; ++n) {
        const JointObservation& observation = problem_.observations[n];
        linearize(observation, state, poses, point, seen, true);
        const Eigen::Index row = node_size_ * static_cast<Eigen::Index>(observation.node);
        Eigen::Vector3d residual = seen.residual + seen.by_pose * step.segment<6>(row);
        if (problem_.moving) residual += seen.by_motion * step.segment<6>(row + 6);
        if (cameras.size() > 0)
          residual += seen.by_camera * cameras.segment<spline_at>(observation.first);
        if (const CalibratedObservation& its = observation.feature.calibrated(); its.depth)
          residual.z() += seen.depth_by_spline.dot(cameras.segment<4>(
              observation.first + spline_at + static_cast<Eigen::Index>(its.terms.first)));
        const Eigen::Matrix3d weighted =
            weight_of(seen.residual, problem_.robust_scale) * seen.by_point.transpose();
        of_point.noalias() += weighted * seen.by_point;
        side.noalias() -= weighted * residual;
      }
      after.points[point] += of_point.inverse() * side;
    }
  });
  return after;
}

// Before anything else moves.
void settle_points(const JointSolver& solver, JointState& state, double& cost) {
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(solver.size_of(state));
  for (int step = 0; step < settling_steps; ++step) {
    JointState settled = solver.stepped(state, still);
    const double settled_cost = solver.cost(settled);
    if (!(settled_cost < cost)) return;
    state = std::move(settled);
    cost = settled_cost;
  }
}

}  // namespace

JointSystem joint_system(const JointProblem& problem, const JointState& state) {
  return JointSolver(problem).system(state);
}

JointSummary adjust_jointly(const JointProblem& problem, JointState& state, int max_iterations,
                            double tolerance) {
  const JointSolver solver(problem);
  JointSummary summary;
  summary.initial_cost = summary.final_cost = solver.cost(state);
  if (!std::isfinite(summary.initial_cost)) return summary;
  summary.converged = true;
  settle_points(solver, state, summary.final_cost);
  double damping = first_damping;
  JointSystem system = solver.system(state);
  for (int rejected = 0; summary.iterations < max_iterations && rejected < max_rejected;) {
    ++summary.iterations;
    Eigen::MatrixXd damped = system.matrix;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> root(damped);
    JointState after;
    double cost = std::numeric_limits<double>::infinity();
    if (root.info() == Eigen::Success) {
      after = solver.stepped(state, root.solve(system.side));
      cost = solver.cost(after);
    }
    if (!(cost <= (1.0 + cost_rounding) * summary.final_cost)) {
      damping = std::max(1e-4, 100.0 * damping);
      ++rejected;
      continue;
    }
    rejected = 0;
    damping = std::max(least_damping, 0.1 * damping);
    const double fall = summary.final_cost - cost;
    state = std::move(after);
    summary.final_cost = cost;
    if (fall < tolerance * cost) break;
    system = solver.system(state);
  }
  return summary;
}

}  // namespace libmap
