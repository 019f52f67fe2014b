#include "libmap/geometry/least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

#include "libmap/geometry/robust.h"

namespace least_squares_test {

using libmap::gauss_newton;
using libmap::LeastSquaresSummary;
using libmap::LevenbergMarquardtOptions;
using libmap::NormalEquations;
using libmap::StepState;

// Rosenbrock's valley: residuals 10 (y - x^2) and 1 - x.
struct Valley {
  Eigen::Vector2d at{-1.2, 1.0};
  Eigen::Vector2d proposed = at;
  NormalEquations<2> equations{};
  std::vector<double> costs{};  // costs of accepted states
  bool solvable = true;

  static Eigen::Vector2d residual(const Eigen::Vector2d& p) {
    return {10.0 * (p.y() - p.x() * p.x()), 1.0 - p.x()};
  }
  static double cost(const Eigen::Vector2d& p) { return 0.5 * residual(p).squaredNorm(); }
  void linearize() {
    Eigen::Matrix2d jacobian;
    jacobian << -20.0 * at.x(), 10.0, -1.0, 0.0;
    equations = {};
    equations.add(jacobian, residual(at), 1.0);
  }
  double propose(double damping) {
    if (!solvable) return std::numeric_limits<double>::infinity();
    Eigen::Matrix2d matrix = equations.matrix;
    matrix.diagonal() *= 1.0 + damping;
    proposed = at + matrix.llt().solve(equations.rhs);
    return cost(proposed);
  }
  void accept() {
    at = proposed;
    costs.push_back(cost(at));
  }
};

TEST(LevenbergMarquardt, FindsTheEndOfAValleyAndNeverRises) {
  Valley valley;
  const double start = Valley::cost(valley.at);
  LevenbergMarquardtOptions options;
  options.tolerance = 1e-12;
  const LeastSquaresSummary summary = libmap::levenberg_marquardt(valley, start, options);
  EXPECT_EQ(summary.initial_cost, start);
  EXPECT_LT((valley.at - Eigen::Vector2d(1.0, 1.0)).norm(), 1e-6);
  EXPECT_EQ(summary.final_cost, valley.costs.back());
  EXPECT_EQ(summary.accepted, static_cast<int>(valley.costs.size()));
  EXPECT_GT(summary.iterations, summary.accepted) << "full steps overshoot: some are rejected";
  double before = start;
  for (const double cost : valley.costs) {
    EXPECT_LE(cost, before * (1.0 + 1e-12));
    before = cost;
  }
}

TEST(LevenbergMarquardt, EndsAtItsLimits) {
  Valley one;
  LevenbergMarquardtOptions options;
  options.max_iterations = 1;
  EXPECT_EQ(libmap::levenberg_marquardt(one, Valley::cost(one.at), options).iterations, 1);
  Valley broken;
  broken.solvable = false;
  options.max_iterations = 100;
  const LeastSquaresSummary summary =
      libmap::levenberg_marquardt(broken, Valley::cost(broken.at), options);
  EXPECT_EQ(summary.iterations, options.max_rejected);
  EXPECT_EQ(summary.accepted, 0);
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(broken.at, Eigen::Vector2d(-1.2, 1.0));
}

TEST(GaussNewton, StopsWhenAStepSaysSo) {
  // The median of 1, 2, 3 and an outlier, by reweighting.
  double at = 5.0;
  const auto summary = gauss_newton(1000, [&] {
    NormalEquations<1> equations;
    for (const double value : {1.0, 2.0, 3.0, 50.0})
      equations.add(Eigen::Matrix<double, 1, 1>(1.0), at - value,
                    libmap::tukey_weight((at - value) / 20.0));
    const double step = equations.rhs[0] / equations.matrix(0, 0);
    at += step;
    return std::abs(step) < 1e-12 ? StepState::converged : StepState::moving;
  });
  EXPECT_EQ(summary.state, StepState::converged);
  EXPECT_NEAR(at, 2.0, 1e-6);
  EXPECT_GT(summary.iterations, 2);
  EXPECT_EQ(gauss_newton(3, [] { return StepState::moving; }).iterations, 3);
  const auto failed = gauss_newton(3, [] { return StepState::failed; });
  EXPECT_EQ(failed.iterations, 1);
  EXPECT_EQ(failed.state, StepState::failed);
}

TEST(Robust, WeightsAreThoseOfTheirLosses) {
  EXPECT_EQ(libmap::tukey_weight(0.0), 1.0);
  EXPECT_EQ(libmap::tukey_weight(-0.5), 0.5625);
  EXPECT_EQ(libmap::tukey_weight(1.0), 0.0);
  EXPECT_EQ(libmap::tukey_weight(-3.0), 0.0);
  EXPECT_EQ(libmap::cauchy_weight(1.0), 0.5);
  EXPECT_NEAR(libmap::tukey_width_of(1.0), 6.946, 1e-3);
}

}  // namespace least_squares_test
