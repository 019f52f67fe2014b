#include "libgtd/grasp/pull_fit.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

namespace {

constexpr double least_force_n = 0.05;  // lower limit of forces
constexpr double prior_fraction = 0.1;  // fraction of the sets of a round drawn from the prior
constexpr int min_rounds = 3;
constexpr double log_force_range = 9.2;  // range of outliers: ln of 0.05 to 500 N

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

Eigen::Vector3d direction_of(const PullTest& test) {
  const double tilt = test.tilt_deg * libmap::radians_per_degree;
  const double azimuth = test.azimuth_deg * libmap::radians_per_degree;
  return {std::sin(tilt) * std::cos(azimuth), std::sin(tilt) * std::sin(azimuth), std::cos(tilt)};
}

// Test with its closed gripper, of which pull forces are computed for any parameters.
struct ClosedTest {
  const PullTest* test;
  ClosedPoses poses;
};

// ln of the forces of all trials, with the lower limit.
std::vector<double> log_forces(const ClosedTest& closed, const Gripper& gripper, int draws) {
  std::vector<double> forces = closed.poses.pull_forces(gripper, direction_of(*closed.test), draws);
  for (double& force : forces) force = std::log(std::max(force, least_force_n));
  return forces;
}

// Prediction of the outcome of a test by the trials of one parameter set.
struct Prediction {
  double likelihood = 0.0;
  double below = 0.0;  // probability of a smaller force, or of a slip if it held
};

Prediction predict(const PullTest& test, const std::vector<double>& log_forces,
                   const PullFitOptions& options) {
  const double noise = options.force_noise;
  const auto count = static_cast<double>(log_forces.size());
  Prediction prediction;
  if (test.force_n) {
    const double observed = std::log(std::max(*test.force_n, least_force_n));
    double density = 0.0;
    for (const double log_force : log_forces) {
      const double z = (observed - log_force) / noise;
      density += std::exp(-0.5 * z * z) / (noise * 2.5066282746310002 * count);
      prediction.below += normal_cdf(z) / count;
    }
    prediction.likelihood =
        (1.0 - options.outlier_fraction) * density + options.outlier_fraction / log_force_range;
    const double probability = (observed - std::log(least_force_n)) / log_force_range;
    prediction.below = (1.0 - options.outlier_fraction) * prediction.below +
                       options.outlier_fraction * std::clamp(probability, 0.0, 1.0);
  } else {
    double held = 0.0;
    for (const double log_force : log_forces)
      held += normal_cdf((log_force - std::log(test.load_n)) / noise) / count;
    held = (1.0 - options.outlier_fraction) * held + 0.5 * options.outlier_fraction;
    prediction.likelihood = test.held ? held : 1.0 - held;
    prediction.below = 1.0 - held;
  }
  return prediction;
}

// Parameter sets as points in the unit cube of the prior's quantiles, where the prior is uniform.
struct Population {
  std::vector<ParameterValues> quantiles;
  std::vector<std::vector<Prediction>> predictions;  // [set][test]
  std::vector<double> log_weights;                   // likelihood divided by the proposal
  std::vector<double> weights;                       // sum 1
};

std::vector<double> normalized(const std::vector<double>& log_weights, double power) {
  const double most = *std::max_element(log_weights.begin(), log_weights.end());
  std::vector<double> weights;
  for (const double log : log_weights) weights.push_back(std::exp(power * (log - most)));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  return weights;
}

double effective_count(const std::vector<double>& weights) {
  return 1.0 / std::inner_product(weights.begin(), weights.end(), weights.begin(), 0.0);
}

// Weights with the likelihood raised to the largest power <= 1 that keeps `least_effective` sets.
std::vector<double> tempered(const std::vector<double>& log_weights, double least_effective) {
  double low = 0.0;
  double high = 1.0;
  std::vector<double> weights = normalized(log_weights, 1.0);
  if (effective_count(weights) >= least_effective) return weights;
  for (int step = 0; step < 40; ++step) {
    const double power = 0.5 * (low + high);
    weights = normalized(log_weights, power);
    (effective_count(weights) >= least_effective ? low : high) = power;
  }
  return normalized(log_weights, low);
}

ParameterValues weighted_spreads(const std::vector<ParameterValues>& points,
                                 const std::vector<double>& weights) {
  ParameterValues spreads{};
  for (std::size_t k = 0; k < uncertain_parameters; ++k) {
    double mean = 0.0;
    double square = 0.0;
    for (std::size_t n = 0; n < points.size(); ++n) {
      mean += weights[n] * points[n][k];
      square += weights[n] * points[n][k] * points[n][k];
    }
    spreads[k] = std::sqrt(std::max(0.0, square - mean * mean));
  }
  return spreads;
}

// Mixture of the prior and normal kernels around weighted centers, reflected at the faces of the
// unit cube. Without the prior, a set far from all kernels would have an unbounded weight.
class Proposal {
 public:
  Proposal(const std::vector<ParameterValues>& centers, const std::vector<double>& weights)
      : centers_(centers), weights_(weights), widths_(weighted_spreads(centers, weights)) {
    // Silverman's rule for six dimensions and the effective number of centers.
    const double scale = 0.92 * std::pow(effective_count(weights), -0.1);
    for (double& width : widths_) width = std::max(0.01, scale * width);
  }

  ParameterValues draw(double probability, libmap::RandomStream& random) const {
    if (random.uniform() < prior_fraction) {
      ParameterValues quantiles;
      for (double& quantile : quantiles) quantile = random.uniform();
      return quantiles;
    }
    std::size_t center = 0;
    for (double sum = weights_[0]; probability >= sum && center + 1 < weights_.size();)
      sum += weights_[++center];
    ParameterValues point = centers_[center];
    for (std::size_t k = 0; k < point.size(); ++k) {
      point[k] = std::abs(std::remainder(point[k] + widths_[k] * random.normal(), 2.0));
    }
    return point;
  }

  double density(const ParameterValues& point) const {
    double sum = 0.0;
    for (std::size_t n = 0; n < centers_.size(); ++n) {
      if (weights_[n] < 1e-9) continue;
      double product = weights_[n];
      for (std::size_t k = 0; k < point.size(); ++k) {
        double kernel = 0.0;
        for (const double image : {point[k], -point[k], 2.0 - point[k]}) {
          const double z = (image - centers_[n][k]) / widths_[k];
          kernel += std::exp(-0.5 * z * z);
        }
        product *= kernel / (widths_[k] * 2.5066282746310002);
      }
      sum += product;
    }
    return prior_fraction + (1.0 - prior_fraction) * sum;
  }

 private:
  const std::vector<ParameterValues>& centers_;
  const std::vector<double>& weights_;
  ParameterValues widths_;
};

class PullFitting {
 public:
  PullFitting(const Ground* ground, const Gripper& gripper, const std::vector<PullTest>& tests,
              const PullFitOptions& options, libmap::Progress& progress)
      : gripper_(gripper),
        options_(options),
        progress_(progress),
        level_mesh_(level_ground()),
        level_(level_mesh_) {
    middle_ = parameters_of(gripper);
    for (const PullTest& test : tests) {
      const std::string row = "row " + std::to_string(test.row);
      const Ground* under = test.on_level_ground ? &level_ : ground;
      if (under == nullptr)
        throw libmap::Error("a test at a location requires a mesh of the ground", {.field = row});
      const Eigen::Vector3d at = test.on_level_ground ? Eigen::Vector3d::Zero() : test.location;
      if (!under->distance(at, options.grasp.max_distance_m))
        throw libmap::Error("not on the mesh",
                            {.field = row,
                             .value = libmap::to_text(at.x()) + "," + libmap::to_text(at.y()) +
                                      "," + libmap::to_text(at.z()),
                             .bound = "within " + libmap::to_text(options.grasp.max_distance_m) +
                                      " m of the mesh"});
      tests_.push_back({&test, ClosedPoses(*under, gripper, at, options.grasp)});
      if (!tests_.back().poses.touch_ground())
        throw libmap::Error("the closed gripper has fewer than two contacts and cannot be pulled",
                            {.field = row});
    }
  }

  PullFit fit() {
    progress_.begin("fit", static_cast<std::size_t>(options_.rounds));
    Population population;
    population.quantiles =
        low_discrepancy_quantiles(static_cast<std::size_t>(options_.sets), options_.grasp.seed);
    weigh(population, nullptr);
    progress_.advance(1);
    const double enough_sets = 0.25 * options_.sets;
    for (int round = 1; round < options_.rounds; ++round) {
      if (round >= min_rounds && effective_count(population.weights) >= enough_sets) break;
      population = next(population, static_cast<std::uint64_t>(round));
      progress_.advance(1);
    }
    progress_.end();
    PullFit result;
    result.effective_sets = effective_count(population.weights);
    result.ensemble = resampled(population);
    find_parameters(population, result);
    check_predictions(population, result);
    Gripper fitted = gripper_;
    result.level_before = force_on_level(fitted);
    fitted.ensemble = result.ensemble;
    result.level_after = force_on_level(fitted);
    return result;
  }

 private:
  // Weighs the sets; without a proposal they are draws of the prior.
  void weigh(Population& population, const Proposal* proposal) {
    const std::size_t count = population.quantiles.size();
    population.predictions.assign(count, {});
    population.log_weights.assign(count, 0.0);
    libmap::parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) {
        const Gripper gripper = with_parameters(
            gripper_, prior_values(gripper_.ranges, middle_, population.quantiles[n]));
        double& log_weight = population.log_weights[n];
        for (const ClosedTest& closed : tests_) {
          population.predictions[n].push_back(
              predict(*closed.test, log_forces(closed, gripper, options_.grasp.draws), options_));
          log_weight += std::log(std::max(1e-300, population.predictions[n].back().likelihood));
        }
        if (proposal != nullptr)
          log_weight -= std::log(std::max(1e-300, proposal->density(population.quantiles[n])));
      }
    });
    population.weights = normalized(population.log_weights, 1.0);
  }

  // Draws new sets around the sets with large weights.
  Population next(const Population& before, std::uint64_t round) {
    const double least_effective = 0.1 * static_cast<double>(before.quantiles.size());
    const std::vector<double> weights = tempered(before.log_weights, least_effective);
    const Proposal proposal(before.quantiles, weights);
    Population population;
    const std::size_t count = before.quantiles.size();
    for (std::size_t n = 0; n < count; ++n) {
      libmap::RandomStream random(options_.grasp.seed, libmap::mix_bits(round, n));
      const double probability =
          (static_cast<double>(n) + random.uniform()) / static_cast<double>(count);
      population.quantiles.push_back(proposal.draw(probability, random));
    }
    weigh(population, &proposal);
    return population;
  }

  // 64 equally weighted sets by systematic resampling; duplicates are merged with double weight.
  std::vector<ParameterSet> resampled(const Population& population) const {
    constexpr std::size_t count = 64;
    std::vector<ParameterSet> sets;
    double sum = 0.0;
    std::size_t taken = 0;
    for (std::size_t n = 0; n < population.weights.size(); ++n) {
      sum += population.weights[n] * count;
      std::size_t times = 0;
      while (taken + times < count && static_cast<double>(taken + times) + 0.5 < sum) ++times;
      if (times > 0)
        sets.push_back({.weight = static_cast<double>(times) / count,
                        .values = prior_values(gripper_.ranges, middle_, population.quantiles[n])});
      taken += times;
    }
    return sets;
  }

  void find_parameters(const Population& population, PullFit& result) const {
    const ParameterValues spreads = weighted_spreads(population.quantiles, population.weights);
    for (std::size_t k = 0; k < uncertain_parameters; ++k) {
      if (!gripper_.ranges[k]) continue;
      FittedParameter fitted;
      fitted.name = uncertain_parameter_names()[k];
      std::vector<std::pair<double, double>> sorted;
      for (std::size_t n = 0; n < population.weights.size(); ++n)
        sorted.emplace_back(population.quantiles[n][k], population.weights[n]);
      std::sort(sorted.begin(), sorted.end());
      const double probabilities[3] = {0.05, 0.5, 0.95};
      for (std::size_t q = 0; q < 3; ++q) {
        ParameterValues at{};
        at.fill(probabilities[q]);
        fitted.prior[q] = prior_values(gripper_.ranges, middle_, at)[k];
        double sum = 0.0;
        for (const auto& [quantile, weight] : sorted) {
          at[k] = quantile;
          if ((sum += weight) >= probabilities[q]) break;
        }
        fitted.fitted[q] = prior_values(gripper_.ranges, middle_, at)[k];
      }
      fitted.spread_ratio = spreads[k] * std::sqrt(12.0);
      result.parameters.push_back(fitted);
    }
  }

  // Predicts each test from the others: its own likelihood is divided out of the weights (Gelfand
  // et al. 1992).
  void check_predictions(const Population& population, PullFit& result) const {
    for (std::size_t t = 0; t < tests_.size(); ++t) {
      std::vector<double> logs = population.log_weights;
      for (std::size_t n = 0; n < logs.size(); ++n)
        logs[n] -= std::log(std::max(1e-300, population.predictions[n][t].likelihood));
      const std::vector<double> weights = normalized(logs, 1.0);
      double below = 0.0;
      for (std::size_t n = 0; n < weights.size(); ++n)
        below += weights[n] * population.predictions[n][t].below;
      const PullTest& test = *tests_[t].test;
      double squared = 0.0;
      double tail = 0.0;
      if (test.force_n) {
        tail = 2.0 * std::min(below, 1.0 - below);
        squared = squared_normal_score(below);
      } else {
        const double held = std::clamp(1.0 - below, 1e-3, 1.0 - 1e-3);
        tail = test.held ? held : 1.0 - held;
        squared = test.held ? (1.0 - held) / held : held / (1.0 - held);
      }
      result.mean_squared_score += squared / static_cast<double>(tests_.size());
      if (tail < 0.01) result.outliers.push_back(test.row);
    }
    const auto n = static_cast<double>(tests_.size());
    result.p_value = boost::math::cdf(
        boost::math::complement(boost::math::chi_squared(n), n * result.mean_squared_score));
  }

  // Squared normal score of a probability, at most 3.5^2.
  static double squared_normal_score(double probability) {
    const double tail = std::max(normal_cdf(-3.5), std::min(probability, 1.0 - probability));
    const double score = boost::math::quantile(boost::math::normal(), tail);
    return score * score;
  }

  PredictedForce force_on_level(const Gripper& gripper) const {
    GraspOptions options = options_.grasp;
    options.poses = 16;
    options.draws = 32;
    options.best_draws = 0;
    const LocationResult result =
        test_grasps(level_, gripper, {Eigen::Vector3d::Zero()}, options, libmap::no_progress())[0];
    return {result.force_range_n[0], result.force_n[1], result.force_range_n[1]};
  }

  const Gripper& gripper_;
  const PullFitOptions& options_;
  libmap::Progress& progress_;
  const libmap::TriangleMesh level_mesh_;
  const Ground level_;
  ParameterValues middle_{};
  std::vector<ClosedTest> tests_;
};

// Entropy of a verdict, bits.
double entropy(double probability) {
  if (probability <= 0.0 || probability >= 1.0) return 0.0;
  return -probability * std::log2(probability) - (1.0 - probability) * std::log2(1.0 - probability);
}

// Returns the load with the most informative verdict, of three that 30 to 70 % of the sets hold.
PlannedPull informative_pull(const std::vector<std::vector<double>>& forces_of_sets,
                             const std::vector<ParameterSet>& sets) {
  std::vector<double> medians;
  for (std::vector<double> forces : forces_of_sets) {
    std::nth_element(forces.begin(),
                     forces.begin() + static_cast<std::ptrdiff_t>(forces.size() / 2), forces.end());
    medians.push_back(forces[forces.size() / 2]);
  }
  PlannedPull best;
  std::vector<double> loads = medians;
  std::sort(loads.begin(), loads.end());
  for (const double probability : {0.3, 0.5, 0.7}) {
    const double load =
        loads[static_cast<std::size_t>(probability * static_cast<double>(loads.size() - 1))];
    if (!(load > 0.1)) continue;
    double held = 0.0;
    double expected = 0.0;
    for (std::size_t s = 0; s < sets.size(); ++s) {
      const std::vector<double>& forces = forces_of_sets[s];
      const double holds =
          static_cast<double>(std::count_if(forces.begin(), forces.end(),
                                            [&](double force) { return force >= load; })) /
          static_cast<double>(forces.size());
      held += sets[s].weight * holds;
      expected += sets[s].weight * entropy(holds);
    }
    const double information = entropy(held) - expected;
    if (information > best.information_bits) {
      best.information_bits = information;
      best.load_n = load;
    }
  }
  return best;
}

}  // namespace

libmap::TriangleMesh level_ground(double half_m) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{-half_m, -half_m, 0.0},
                   {half_m, -half_m, 0.0},
                   {half_m, half_m, 0.0},
                   {-half_m, half_m, 0.0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

PullFit fit_pulls(const Ground* ground, const Gripper& gripper, const std::vector<PullTest>& tests,
                  const PullFitOptions& options, libmap::Progress& progress) {
  if (tests.empty()) throw libmap::Error("are missing", {.field = "pull tests"});
  options.grasp.check();
  gripper.check();
  require_fingers(gripper);
  if (std::none_of(gripper.ranges.begin(), gripper.ranges.end(),
                   [](const auto& range) { return range.has_value(); }))
    throw libmap::Error("is missing: a fit requires a range of a parameter", {.field = "ranges"});
  return PullFitting(ground, gripper, tests, options, progress).fit();
}

std::vector<PlannedPull> plan_pulls(const Ground& ground, const Gripper& gripper,
                                    const std::vector<Eigen::Vector3d>& candidates,
                                    std::size_t count, const PullFitOptions& options,
                                    libmap::Progress& progress) {
  require_fingers(gripper);
  const std::vector<ParameterSet> sets = parameter_sets(gripper);
  std::vector<PlannedPull> plans(candidates.size());
  progress.begin("plan", candidates.size());
  libmap::parallel_for(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      progress.advance(1);
      const ClosedPoses poses(ground, gripper, candidates[n], options.grasp);
      if (!poses.touch_ground()) continue;
      for (const PullDirection& direction : pull_directions()) {
        if (direction.tilt_deg > 45) continue;
        std::vector<std::vector<double>> forces;
        for (const ParameterSet& set : sets)
          forces.push_back(poses.pull_forces(with_parameters(gripper, set.values), direction.vector,
                                             options.grasp.draws));
        PlannedPull plan = informative_pull(forces, sets);
        if (plan.information_bits <= plans[n].information_bits) continue;
        plan.location = n;
        plan.direction = direction;
        plans[n] = plan;
      }
    }
  });
  progress.end();
  std::erase_if(plans, [](const PlannedPull& plan) { return !(plan.information_bits > 0.0); });
  std::stable_sort(plans.begin(), plans.end(), [](const PlannedPull& a, const PlannedPull& b) {
    return a.information_bits > b.information_bits;
  });
  if (plans.size() > count) plans.resize(count);
  return plans;
}

}  // namespace libgtd
