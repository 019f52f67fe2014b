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
  std::optional<double> force_n;  // force at which the gripper slipped; nullopt: use load_n, held
  double load_n = 0.0;            // applied load if there is no force_n
  bool held = false;              // verdict: the gripper held load_n
};

// Reads pull tests from the columns x, y, z (m, in the mesh frame) or ground (level); tilt_deg,
// azimuth_deg (0 if missing or empty); force_n, or load_n and held (0 or 1). Throws Error naming
// file, row, column and bound if there are no rows, a location is missing, a force is negative, or
// a row does not have exactly one of force_n and held (with load_n).
std::vector<PullTest> pull_tests_of(const libmap::Table& table);

struct PullFitOptions {
  GraspOptions grasp;              // `poses` and `draws` apply to each pull
  double force_noise = 0.15;       // standard deviation of the logarithm of a measured force
  double outlier_fraction = 0.05;  // prior fraction of uninformative tests
  int sets = 256;                  // number of parameter sets per round
  int rounds = 8;                  // maximum; from round 3, ends if effective_sets >= sets / 4
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
  double fitted[3] = {};  // these quantiles after the fit
  // The parameter is expressed as its quantile in the prior. Ratio of the standard deviations of
  // this quantile after and before the fit; below 0.6, the tests determine the parameter.
  double spread_ratio = 1.0;

  bool is_determined() const { return spread_ratio < 0.6; }
};

struct PullFit {
  std::vector<ParameterSet> ensemble;        // at most 64 parameter sets
  double effective_sets = 0.0;               // 1 / sum of squared weights of the last round
  PredictedForce level_before, level_after;  // on level ground; before and after the fit
  std::vector<FittedParameter> parameters;   // parameters with a range
  // Mean over the tests of the squared standard score of a test, predicted from all other tests
  // (leave-one-out weights); about 1 if the model explains the tests. p_value: probability of a
  // value at least as large by chance.
  double mean_squared_score = 0.0;
  double p_value = 1.0;
  // Rows of tests with an outcome of probability < 0.01, predicted from the other tests.
  std::vector<std::size_t> outliers;

  bool explains_tests() const { return p_value >= 0.02; }
};

// Fits the parameters to the tests. `ground` may be null if all tests are on level ground. Throws
// Error if there are no tests or the gripper has no `fingers` or `ranges`. Throws Error naming the
// row if a test has no ground, is not on the mesh, or makes no contact.
PullFit fit_pulls(const Ground* ground, const Gripper& gripper, const std::vector<PullTest>& tests,
                  const PullFitOptions& options, libmap::Progress& progress);

// Returns level ground: a square at z = 0 with its center at the origin and the side 2 half_m.
libmap::TriangleMesh level_ground(double half_m = 0.4);

// Pull with an outcome that differs between the parameter sets.
struct PlannedPull {
  std::size_t location = 0;  // index in `candidates` of plan_pulls
  PullDirection direction;
  double load_n = 0.0;            // the best of three loads that 30 to 70 % of the sets hold
  double information_bits = 0.0;  // expected entropy reduction of the sets' weights
};

// Returns at most `count` pulls (tilt 0 or 45 degrees) with the most information (descending), at
// most one per candidate (mesh frame, m) with contact. Throws Error as require_fingers does.
std::vector<PlannedPull> plan_pulls(const Ground& ground, const Gripper& gripper,
                                    const std::vector<Eigen::Vector3d>& candidates,
                                    std::size_t count, const PullFitOptions& options,
                                    libmap::Progress& progress);

}  // namespace libgtd
