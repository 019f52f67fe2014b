// Fit of a gripper's parameters to pull tests: an ensemble of parameter sets that explains them, by
// population Monte Carlo (Cappe et al. 2004) from the prior of the gripper file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libmap/core/progress.h"
#include "libmap/core/table.h"

namespace libgtd {

// A pull of the closed gripper. The direction is given as PullDirection: tilt 0 is away from the
// ground along the palm's axis.
struct PullTest {
  std::size_t row = 0;  // of the table, from 1
  Eigen::Vector3d location = Eigen::Vector3d::Zero();
  bool on_level_ground = false;  // instead of the location
  double tilt_deg = 0.0;
  double azimuth_deg = 0.0;
  std::optional<double> force_n;  // at which the gripper slipped; nothing: only a verdict
  double load_n = 0.0;            // of the verdict
  bool held = false;
};

// Columns: x, y, z (m, in the mesh's frame) or ground = level; tilt_deg, azimuth_deg (0 where they
// are missing or empty); force_n, or load_n and held (0 or 1). Throws Error naming file, row,
// column and bound: no rows, no location, a negative force, a verdict without load, neither or
// both.
std::vector<PullTest> pull_tests_of(const libmap::Table& table);

struct PullFitOptions {
  GraspOptions grasp;           // poses and draws of a pull: the fields of the same names
  double force_noise = 0.15;    // standard deviation of the logarithm of a measured force
  double outlier_share = 0.05;  // of tests that say nothing
  int sets = 256;               // of a round
  int rounds = 8;               // at most; fewer if a quarter of the sets are effective
};

// Median and 90 % interval.
struct PredictedForce {
  double low_n = 0.0;
  double median_n = 0.0;
  double high_n = 0.0;
};

struct FittedParameter {
  std::string name;
  double prior[3] = {};  // quantiles 0.05, 0.5, 0.95
  double fitted[3] = {};
  // Standard deviation of its quantile in the prior, relative to that before the tests. The tests
  // determine a parameter where this is below 0.6.
  double spread_ratio = 1.0;

  bool is_determined() const { return spread_ratio < 0.6; }
};

struct PullFit {
  std::vector<ParameterSet> ensemble;        // 64 sets at most
  double effective_sets = 0.0;               // of the last round: 1 / sum of squared weights
  PredictedForce level_before, level_after;  // holding force on level ground
  std::vector<FittedParameter> parameters;   // those with a range
  // Each test predicted from all others (leave-one-out weights): mean squared standard score, about
  // 1 if the model explains the tests, and the probability of one as large by chance.
  double mean_squared_score = 0.0;
  double chance = 1.0;
  std::vector<std::size_t>
      outliers;  // rows whose outcome has a probability below 0.01 from the others

  bool explains_tests() const { return chance >= 0.02; }
};

// `ground` may be null if all tests are on level ground. Throws Error: no tests, no `fingers`, no
// `ranges`, a location off the mesh or a pull without contact (row as field).
PullFit fit_pulls(const Ground* ground, const Gripper& gripper, const std::vector<PullTest>& tests,
                  const PullFitOptions& options, libmap::Progress& progress);

// Level ground, the square of this half side about the origin.
libmap::TriangleMesh level_ground(double half_m = 0.4);

// A pull whose outcome the parameter sets predict differently.
struct PlannedPull {
  std::size_t location = 0;  // index in the candidates
  PullDirection direction;
  double load_n = 0.0;            // about half of the sets hold it
  double information_bits = 0.0;  // expected reduction of the entropy of the weights by its verdict
};

// The `count` pulls, each at another location, of the most information in descending order.
std::vector<PlannedPull> plan_pulls(const Ground& ground, const Gripper& gripper,
                                    const std::vector<Eigen::Vector3d>& candidates,
                                    std::size_t count, const PullFitOptions& options,
                                    libmap::Progress& progress);

}  // namespace libgtd
