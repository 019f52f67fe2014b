#include "libgtd/score/force_distribution.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <tuple>

#include "libgtd/gripper/target_clones.h"

namespace libgtd {

namespace {

// Coefficients fitted to trials of the virtual field test (grasp) on simulated rocks, slopes, walls
// and shapes with the three grippers and 16 parameter sets of each, by the likelihood that a trial
// reaches each of nine loads. c is the mean of the capacities C of the columns, p the fraction of
// columns with C > floor_of_capacity; mean and spread of ln C are over these. v is the spread of a
// finger's pull on level ground (FingerPulls::level_spreads):
//   P(force > 0) = logistic(1.234 + 1.623 p + 3.988 contact + 0.679 ln(c + offset) - 1.203 v),
//   mean ln(force / closing forces) = 0.293 + 1.006 mean(ln C) - 0.446 rise + 0.663 tilt - 0.537 v,
//   ln(spread of ln force) = -1.540 + 1.056 spread(ln C) + 0.745 v.
// contact: fraction of the azimuths with spine contact on the weakest side; rise of the palm above
// the voxel, and tilt: imbalance of the depths of the contacts, both in finger lengths. The weakest
// of several random pulls decreases with their spread, hence v.
constexpr float floor_of_capacity = 0.0005F;
constexpr float offset_of_capacity = 0.003F;
constexpr float largest_capacity = 0.55F;
// Distribution of ln(force) between trials: beta(4, 2), skewed to small forces. Its standard
// deviation, and its mean from the upper end.
constexpr float beta_spread = 0.17817416F;
constexpr float beta_mean = 1.0F / 3.0F;
// Forces at which the distribution over all sets is computed: from 0.2 N to 1.3 kN.
constexpr float first_log_force = -1.6F;
constexpr float log_force_step = 0.19F;

// Adds a column. `logs` is 0 if a capacity is not above the floor.
GRASPMAP_CLONED_CHOICE void add_to_sums(const float* __restrict capacities,
                                        const float* __restrict logs, float weight, SetSums& sums) {
  float* __restrict weights = sums.weights.data();
  float* __restrict sum = sums.logs.data();
  float* __restrict squares = sums.squares.data();
  float* __restrict all = sums.capacities.data();
  const std::size_t sets = sums.weights.size();
  for (std::size_t s = 0; s < sets; ++s) {
    weights[s] += capacities[s] > floor_of_capacity ? weight : 0.0F;
    sum[s] += weight * logs[s];
    squares[s] += weight * logs[s] * logs[s];
    all[s] += weight * capacities[s];
  }
}

// exp and ln with error 2e-4, vectorizable.
[[gnu::always_inline]] inline float quick_exp(float x) {
  const float power = x * 1.44269504F + 127.0F;  // power of 2, biased
  const auto whole = static_cast<std::int32_t>(power);
  const float part = power - static_cast<float>(whole);
  const float scale = std::bit_cast<float>(whole << 23);
  return scale * (1.0F + part * (0.6957F + part * (0.2261F + part * 0.0782F)));
}
[[gnu::always_inline]] inline float quick_log(float x) {
  const auto bits = std::bit_cast<std::int32_t>(x);
  const auto power = static_cast<float>((bits >> 23) - 127);
  const float part = std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000) - 1.0F;
  return 0.69314718F * power +
         part * (0.99949F +
                 part * (-0.49190F + part * (0.28947F + part * (-0.13606F + part * 0.03215F))));
}

// Means over the columns for find_forces, which computes the distribution of the force of each set.
struct MeanTerms {
  float contact = 0.0F;
  float bias = 0.0F;     // terms of rise and tilt in ln(force)
  float weights = 0.0F;  // sum over all columns
};
GRASPMAP_CLONED_CHOICE void find_forces(const SetSums& sums, const MeanTerms& mean,
                                        const float* __restrict log_scale,
                                        const float* __restrict pull_spreads, SetForces& forces) {
  const float* __restrict weights = sums.weights.data();
  const float* __restrict logs = sums.logs.data();
  const float* __restrict squares = sums.squares.data();
  const float* __restrict capacities = sums.capacities.data();
  float* __restrict probability = forces.probability.data();
  float* __restrict log_force = forces.log_force.data();
  float* __restrict level_spreads = forces.spread.data();
  float* __restrict scale = forces.scale.data();
  const std::size_t sets = sums.weights.size();
  for (std::size_t s = 0; s < sets; ++s) {
    const bool has_force = weights[s] > 0.0F;
    const float count = has_force ? weights[s] : 1.0F;
    const float log = logs[s] / count;
    const float variance = squares[s] / count - log * log;
    const float spread = std::sqrt(variance > 0.0F ? variance : 0.0F);
    const float logit = 1.234F + 1.623F * count / mean.weights + 3.988F * mean.contact +
                        0.679F * quick_log(capacities[s] / mean.weights + offset_of_capacity) -
                        1.203F * pull_spreads[s];
    probability[s] = has_force ? 1.0F / (1.0F + quick_exp(-logit)) : 0.0F;
    log_force[s] = log_scale[s] + mean.bias + 1.006F * log - 0.537F * pull_spreads[s];
    const float log_spread = -1.540F + 1.056F * spread + 0.745F * pull_spreads[s];
    const float low = log_spread > -3.0F ? log_spread : -3.0F;
    level_spreads[s] = quick_exp(low < 1.0F ? low : 1.0F);
    scale[s] = beta_spread / level_spreads[s];
  }
}

// P(force >= exp(log_forces[n])) over all sets, for each n.
GRASPMAP_CLONED_CHOICE void find_survivals(const float* weights, const SetForces& forces,
                                           const ForceGrid& log_forces, ForceGrid& survivals) {
  constexpr std::size_t force_steps = std::tuple_size_v<ForceGrid>;
  float sums[force_steps] = {};
  float at[force_steps];
  std::copy(log_forces.begin(), log_forces.end(), std::begin(at));
  const std::size_t sets = forces.probability.size();
  for (std::size_t s = 0; s < sets; ++s) {
    const float weight = weights[s] * forces.probability[s];
    const float scale = forces.scale[s];
    const float start = beta_mean + forces.log_force[s] * scale;
    for (std::size_t n = 0; n < force_steps; ++n) {
      const float fraction = start - at[n] * scale;
      const float below_one = fraction < 1.0F ? fraction : 1.0F;
      const float t = below_one > 0.0F ? below_one : 0.0F;
      sums[n] += weight * t * t * (10.0F + t * (-20.0F + t * (15.0F - 4.0F * t)));
    }
  }
  std::copy(std::begin(sums), std::end(sums), survivals.begin());
}

}  // namespace

GRASPMAP_CLONED_CHOICE void bound_capacities(float* __restrict capacities, float* __restrict logs,
                                             std::size_t sets) {
  for (std::size_t s = 0; s < sets; ++s) {
    const float ratio = capacities[s] / largest_capacity;
    const float bounded = capacities[s] / std::sqrt(1.0F + ratio * ratio);
    capacities[s] = bounded;
    logs[s] = bounded > floor_of_capacity ? quick_log(bounded) : 0.0F;
  }
}

ForceDistribution::ForceDistribution(const ClosingPath& path)
    : path_(path), sums_(path.pulls.sets) {
  for (auto* values : {&forces_.probability, &forces_.log_force, &forces_.spread, &forces_.scale})
    values->resize(path.pulls.sets);
  for (const double force : path.pulls.total_closing_forces_n)
    log_scale_.push_back(static_cast<float>(std::log(force)));
  for (std::size_t n = 0; n < log_forces_.size(); ++n)
    log_forces_[n] = first_log_force + static_cast<float>(n) * log_force_step;
  log_forces_.back() = static_cast<float>(std::log(path.load_n));
  for (const ParameterSet& set : path.sets) weights_.push_back(static_cast<float>(set.weight));
}

void ForceDistribution::clear() { sums_.clear(); }

void ForceDistribution::add_column(const float* capacities, const float* logs, float weight) {
  add_to_sums(capacities, logs, weight, sums_);
}

ForceEstimate ForceDistribution::estimate(const RestSums& rests) {
  const double lengths = rests.weights * path_.finger_length_m;
  find_forces(
      sums_,
      {.contact = static_cast<float>(rests.contact / rests.weights),
       .bias = static_cast<float>(0.293 + (0.663 * rests.tilt_m - 0.446 * rests.rise_m) / lengths),
       .weights = static_cast<float>(rests.weights)},
      log_scale_.data(), path_.pulls.level_spreads.data(), forces_);
  ForceEstimate result;
  ForceGrid survivals;
  find_survivals(weights_.data(), forces_, log_forces_, survivals);
  result.hold_probability = std::min(1.0F, survivals.back());
  const auto quantile = [&](float above) {
    if (survivals.front() <= above) return 0.0F;
    std::size_t n = 1;
    while (n + 2 < survivals.size() && survivals[n] > above) ++n;
    const float fraction = std::min(
        1.0F, (survivals[n - 1] - above) / std::max(1e-9F, survivals[n - 1] - survivals[n]));
    return std::exp(log_forces_[n - 1] + fraction * log_force_step);
  };
  result.median_n = quantile(0.5F);
  result.low_n = quantile(0.95F);
  result.high_n = quantile(0.05F);
  float weight = 0.0F;
  float log = 0.0F;
  float square = 0.0F;
  for (std::size_t s = 0; s < path_.pulls.sets; ++s) {
    const float set_weight = weights_[s] * forces_.probability[s];
    if (set_weight <= 0.0F) continue;
    weight += set_weight;
    log += set_weight * forces_.log_force[s];
    square += set_weight * forces_.log_force[s] * forces_.log_force[s];
    result.trial_spread += set_weight * forces_.spread[s];
  }
  if (weight > 0.0F) {
    result.trial_spread /= weight;
    log /= weight;
    result.parameter_spread = std::sqrt(std::max(0.0F, square / weight - log * log));
  }
  return result;
}

}  // namespace libgtd
