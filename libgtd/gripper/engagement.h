// Engagement of spines with rough rock: its parameters, the range in which each of them is known,
// and ensembles of parameter sets.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"

namespace libgtd {

// The section `engagement` of a gripper file. Each spine meets a facet that leans against its drag
// by a random angle psi, with Coulomb friction on it (Asbeck et al. 2006; Chen et al. 2024,
// arXiv 2407.00973).
struct Engagement {
  double friction = 0.39;         // coefficient of Coulomb friction, of spines and links
  double asperity_min_deg = 0.0;  // psi is uniform between the two
  double asperity_max_deg = 90.0;
  double engagement_rate = 0.6;  // 1/mm; a spine meets a facet with 1 - exp(-rate * drag)
  double drag_mm = 5.0;

  // Throws Error naming the key, its value and the bound that it breaks.
  void check() const;
};
// The keys "engagement.KEY" of a gripper file, bound to `engagement`.
void bind(libmap::ParameterTable& table, Engagement& engagement);

// Share of spines that meet a facet. The rate is scaled by the share of asperities that a tip of
// this radius can use, relative to a tip of 25 micrometers: 2.49 (r + 39.44)^-0.7116 - 0.01212
// (fitted to concrete, Chen et al. 2024).
double engagement_share(const Engagement& engagement, double spine_tip_radius_um);

// The uncertain parameters of a gripper: spine_force_limit_n and closing_force_n of `fingers`;
// friction, asperity_min_deg, asperity_max_deg and engagement_rate of `engagement`; in this order.
constexpr std::size_t uncertain_parameters = 6;
using ParameterValues = std::array<double, uncertain_parameters>;
const std::array<std::string, uncertain_parameters>& uncertain_parameter_names();

// Bounds of a parameter's prior: half of it is between `low` and the value of the gripper file,
// half between this value and `high`, uniform in the logarithm of forces, friction and rate and in
// angles. A value on a bound leaves one part, from bound to bound.
struct ParameterRange {
  double low = 0.0;
  double high = 0.0;
};
// The section `ranges` of a gripper file; without a range, a parameter is known.
using ParameterRanges = std::array<std::optional<ParameterRange>, uncertain_parameters>;

// The parameters at these quantiles (0 .. 1) of a prior about `middle`.
ParameterValues prior_values(const ParameterRanges& ranges, const ParameterValues& middle,
                             const ParameterValues& quantiles);

struct ParameterSet {
  double weight = 1.0;  // 1 in sum over an ensemble
  ParameterValues values{};
};

// `count` quantiles of low discrepancy: Roberts' sequence of six dimensions (2018), shifted by the
// seed.
std::vector<ParameterValues> low_discrepancy_quantiles(std::size_t count, std::uint64_t seed);

// The place of `share` (0 .. 1) in the cumulative weights: with evenly spread shares, sets are
// drawn in proportion to their weights.
std::size_t set_at(const std::vector<ParameterSet>& ensemble, double share);

}  // namespace libgtd
