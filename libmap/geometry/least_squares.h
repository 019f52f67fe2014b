// Solvers for nonlinear least squares: Levenberg-Marquardt and Gauss-Newton iterations. The problem
// provides normal equations and a solver, dense, sparse or of fixed size.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace libmap {

// Normal equations J^T W J x = -J^T W r of the step x, with residuals r, weights W, Jacobian J.
template <int size>
struct NormalEquations {
  Eigen::Matrix<double, size, size> matrix = Eigen::Matrix<double, size, size>::Zero();
  Eigen::Matrix<double, size, 1> rhs = Eigen::Matrix<double, size, 1>::Zero();

  template <typename Jacobian, typename Residual>
  void add(const Jacobian& jacobian, const Residual& residual, double weight) {
    matrix += weight * jacobian.transpose() * jacobian;
    rhs -= weight * jacobian.transpose() * residual;
  }
};

struct LevenbergMarquardtOptions {
  int max_iterations = 100;
  double tolerance = 1e-6;      // relative decrease of the cost below which the state has converged
  double rounding = 1e-12;      // accepted relative increase of the cost, by rounding errors
  int max_rejected = 8;         // maximum number of consecutive rejected steps
  double first_damping = 1e-6;  // damping of the first step
  double min_damping = 1e-9;    // minimum; an accepted step divides the damping by 10
  double raised_damping = 1e-4;  // minimum after a rejected step, which multiplies damping by 100
};

struct LeastSquaresSummary {
  double initial_cost = 0.0;
  double final_cost = 0.0;
  int iterations = 0;  // number of accepted and rejected steps
  int accepted = 0;    // number of accepted steps
  bool converged = false;
};

// Levenberg-Marquardt (Marquardt 1963). `cost` is the finite cost of the problem's initial state.
// The class Problem must have the functions
//   void linearize()                computes the normal equations at the current state
//   double propose(double damping)  solves the equations for a step; returns the cost of the state
//                                   after the step, infinity if there is no step
//   void accept()                   replaces the current state by the proposed state
template <typename Problem>
LeastSquaresSummary levenberg_marquardt(Problem& problem, double cost,
                                        const LevenbergMarquardtOptions& options) {
  LeastSquaresSummary summary{.initial_cost = cost, .final_cost = cost};
  double damping = options.first_damping;
  problem.linearize();
  for (int rejected = 0;
       summary.iterations < options.max_iterations && rejected < options.max_rejected;) {
    ++summary.iterations;
    const double proposed = problem.propose(damping);
    if (!(proposed <= (1.0 + options.rounding) * summary.final_cost)) {
      damping = std::max(options.raised_damping, 100.0 * damping);
      ++rejected;
      continue;
    }
    rejected = 0;
    damping = std::max(options.min_damping, 0.1 * damping);
    problem.accept();
    ++summary.accepted;
    const double fall = summary.final_cost - proposed;
    summary.final_cost = proposed;
    summary.converged = fall < options.tolerance * proposed;
    if (summary.converged) break;
    problem.linearize();
  }
  return summary;
}

// Outcome of a step of gauss_newton.
enum class StepState { moving, converged, failed };

struct GaussNewtonSummary {
  int iterations = 0;
  StepState state = StepState::moving;
};

// Gauss-Newton for problems with weights or correspondences that change in each step (ICP,
// iteratively reweighted least squares), so that costs cannot be compared. `step()` linearizes,
// moves the state and returns a StepState; it is called while it returns `moving`.
template <typename Step>
GaussNewtonSummary gauss_newton(int max_iterations, const Step& step) {
  GaussNewtonSummary summary;
  while (summary.iterations < max_iterations && summary.state == StepState::moving) {
    ++summary.iterations;
    summary.state = step();
  }
  return summary;
}

}  // namespace libmap
