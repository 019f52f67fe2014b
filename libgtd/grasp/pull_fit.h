// Fits the uncertain force parameters of a gripper to measured pull tests. The result is an
// ensemble of weighted parameter sets, by population Monte Carlo (Cappe et al. 2004) from the prior
// of the gripper file. Also plans informative tests.
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

// Pull of a closed gripper. The direction is defined as in PullDirection: tilt 0 is away from the
// ground along the palm's axis.
struct PullTest {
  std::size_t row = 0;                                 // row of the table, from 1
  Eigen::Vector3d location = Eigen::Vector3d::Zero();  // m, in the mesh frame
  bool on_level_ground = false;                        // true: the location is not used
  double tilt_deg = 0.0;
  double azimuth_deg = 0.0;
  std::optional<double> force_n;  // force at which the gripper slipped; nullopt: verdict only
  double load_n = 0.0;            // load of the verdict
  bool held = false;
};

// Reads pull tests from the columns x, y, z (m, in the mesh frame) or ground = level; tilt_deg,
// azimuth_deg (0 if missing or empty); force_n, or load_n and held (0 or 1). Throws Error naming
// file, row, column and bound if there are no rows, no location, a negative force, a verdict
// without a load, or not exactly one of force and verdict.
std::vector<PullTest> pull_tests_of(const libmap::Table& table);

struct PullFitOptions {
  GraspOptions grasp;              // `poses` and `draws` apply to each pull
  double force_noise = 0.15;       // standard deviation of the logarithm of a measured force
  double outlier_fraction = 0.05;  // prior fraction of uninformative tests
  int sets = 256;                  // number of parameter sets per round
  int rounds = 8;                  // maximum; from 3 on, ends if 1/4 of the sets are effective
};

// Median and 90 % interval of a holding force.
struct PredictedForce {
  double low_n = 0.0;
  double median_n = 0.0;
  double high_n = 0.0;
};

struct FittedParameter {
  std::string name;
  double prior[3] = {};   // quantiles 0.05, 0.5, 0.95 of the prior
  double fitted[3] = {};  // the same quantiles after the tests
  // Standard deviation of the parameter's quantile in the prior, relative to the value before the
  // tests. The tests determine the parameter if the ratio is below 0.6.
  double spread_ratio = 1.0;

  bool is_determined() const { return spread_ratio < 0.6; }
};

struct PullFit {
  std::vector<ParameterSet> ensemble;        // at most 64 sets
  double effective_sets = 0.0;               // last round: 1 / sum of squared weights
  PredictedForce level_before, level_after;  // holding force on level ground
  std::vector<FittedParameter> parameters;   // parameters with a range
  // Mean squared standard score of each test predicted from all others (leave-one-out weights),
  // about 1 if the model explains the tests. p_value: probability of a value at least as large by
  // chance.
  double mean_squared_score = 0.0;
  double p_value = 1.0;
  std::vector<std::size_t> outliers;  // rows of tests with probability < 0.01 by the other tests

  bool explains_tests() const { return p_value >= 0.02; }
};

// Fits the parameters to the tests. `ground` may be null if all tests are on level ground. Throws
// Error if there are no tests, the gripper has no `fingers` or `ranges`, and for a location without
// `ground` or off the mesh and a pull without contact (the field is the row).
PullFit fit_pulls(const Ground* ground, const Gripper& gripper, const std::vector<PullTest>& tests,
                  const PullFitOptions& options, libmap::Progress& progress);

// Returns level ground: a square around the origin with half the side `half_m`.
libmap::TriangleMesh level_ground(double half_m = 0.4);

// Pull with an outcome that differs between the parameter sets.
struct PlannedPull {
  std::size_t location = 0;  // index in the candidates
  PullDirection direction;
  double load_n = 0.0;            // the most informative of three loads that 30 to 70 % hold
  double information_bits = 0.0;  // expected entropy reduction of the weights by the verdict
};

// Returns at most `count` pulls (tilt 0 or 45 degrees) with the most information, in descending
// order, each at a different location with contact. Throws Error if the gripper has no `fingers`.
std::vector<PlannedPull> plan_pulls(const Ground& ground, const Gripper& gripper,
                                    const std::vector<Eigen::Vector3d>& candidates,
                                    std::size_t count, const PullFitOptions& options,
                                    libmap::Progress& progress);

}  // namespace libgtd
