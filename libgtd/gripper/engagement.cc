// Implements the engagement and the uncertain parameters of gripper.h.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libgtd/gripper/gripper.h"
#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

namespace {

// Fraction of a concrete's asperities that a spine tip can use (Chen et al. 2024).
double usable_asperities(double tip_radius_um) {
  return std::max(0.0, 2.49 * std::pow(tip_radius_um + 39.44, -0.7116) - 0.01212);
}

constexpr std::array<bool, uncertain_parameters> is_logarithmic{true,  true,  true,
                                                                false, false, true};

double between(double low, double high, double fraction, bool logarithmic) {
  return logarithmic ? low * std::pow(high / low, fraction) : low + fraction * (high - low);
}

}  // namespace

void Engagement::check() const {
  libmap::check_parameters(*this);
  if (asperity_min_deg > asperity_max_deg)
    throw libmap::Error(
        "exceeds the maximum inclination",
        {.field = "engagement.asperity_min_deg",
         .value = libmap::to_text(asperity_min_deg),
         .bound = "<= engagement.asperity_max_deg = " + libmap::to_text(asperity_max_deg)});
}

void bind(libmap::ParameterTable& table, Engagement& engagement) {
  constexpr libmap::Range angle_range{0.0, 90.0};
  table.add("engagement.friction", engagement.friction, libmap::not_negative,
            "coefficient of Coulomb friction of spines and links on the ground");
  table.add("engagement.asperity_min_deg", engagement.asperity_min_deg, angle_range,
            "minimum slope of asperities' facets, which face the dragged spine, degrees");
  table.add("engagement.asperity_max_deg", engagement.asperity_max_deg, angle_range,
            "maximum slope of asperities' facets, which face the dragged spine, degrees");
  table.add("engagement.engagement_rate", engagement.engagement_rate, libmap::not_negative,
            "mean number of facets that a spine meets per mm of drag, 1/mm");
  table.add("engagement.drag_mm", engagement.drag_mm, libmap::not_negative,
            "distance over which the closing gripper drags its spines, mm");
}

double engagement_fraction(const Engagement& engagement, double spine_tip_radius_um) {
  const double scale = usable_asperities(spine_tip_radius_um) / usable_asperities(25.0);
  return -std::expm1(-scale * engagement.engagement_rate * engagement.drag_mm);
}

const std::array<std::string, uncertain_parameters>& uncertain_parameter_names() {
  static const std::array<std::string, uncertain_parameters> names{
      "spine_force_limit_n", "closing_force_n",  "friction",
      "asperity_min_deg",    "asperity_max_deg", "engagement_rate"};
  return names;
}

ParameterValues prior_values(const ParameterRanges& ranges, const ParameterValues& middle,
                             const ParameterValues& quantiles) {
  ParameterValues values = middle;
  for (std::size_t n = 0; n < values.size(); ++n) {
    if (!ranges[n]) continue;
    const auto [low, high] = *ranges[n];
    const double fraction = quantiles[n];
    if (!(middle[n] > low && middle[n] < high))
      values[n] = between(low, high, fraction, is_logarithmic[n]);
    else if (fraction < 0.5)
      values[n] = between(low, middle[n], 2.0 * fraction, is_logarithmic[n]);
    else
      values[n] = between(middle[n], high, 2.0 * fraction - 1.0, is_logarithmic[n]);
  }
  return values;
}

std::vector<ParameterValues> low_discrepancy_quantiles(std::size_t count, std::uint64_t seed) {
  // Real root of x^7 = x + 1.
  double root = 1.1;
  for (int step = 0; step < 60; ++step) root = std::pow(1.0 + root, 1.0 / 7.0);
  std::vector<ParameterValues> quantiles(count);
  for (std::size_t n = 0; n < count; ++n)
    for (std::size_t k = 0; k < uncertain_parameters; ++k) {
      const double start = libmap::unit_noise(seed, k);
      const double at = start + static_cast<double>(n + 1) / std::pow(root, k + 1);
      quantiles[n][k] = at - std::floor(at);
    }
  return quantiles;
}

std::size_t parameter_set_at(const std::vector<ParameterSet>& ensemble, double fraction) {
  double sum = 0.0;
  for (std::size_t n = 0; n < ensemble.size(); ++n) {
    sum += ensemble[n].weight;
    if (fraction < sum) return n;
  }
  return ensemble.size() - 1;
}

}  // namespace libgtd
