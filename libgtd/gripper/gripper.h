// The measures of a spined gripper (tab. 3-2 of the thesis), as its makers give them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"

namespace libgtd {

// The section `fingers` of a gripper file: what the virtual field test (libgtd/grasp) needs beyond
// the measures of the mask.
struct GripperFingers {
  int count = 0;                     // evenly around the palm's axis
  double curl_deg = 0.0;             // distal against proximal link, inward, of a free finger
  double curl_limit_deg = 0.0;       // the same at most, once the proximal link is stopped
  int spines_per_finger = 0;         // on the outer half of the distal link
  double spine_tip_radius_um = 0.0;  // of the tip's rounding, micrometers
  double spine_force_limit_n = 0.0;  // that one spine or the asperity under it bears
  double closing_force_n = 0.0;      // of one finger, toward the palm's axis
  bool holds_when_closed = false;    // the drive resists any opening force, e.g. a ball screw

  // Throws Error naming the key, its value and the bound that it breaks.
  void check() const;
};

// The keys "fingers.KEY" of a gripper file, bound to `fingers`.
void bind(libmap::ParameterTable& table, GripperFingers& fingers);

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

// Millimeters and degrees.
struct Gripper {
  std::string name;
  double palm_diameter_mm = 0.0;
  double finger_joint_diameter_mm = 0.0;  // over the finger joints
  double finger_length_mm = 0.0;          // joint to spine carrier
  double spine_length_mm = 0.0;           // carrier to spine tip
  double spine_depth_mm = 0.0;            // of a spine in the ground
  double opening_angle_deg = 0.0;         // of a finger from the palm's axis, wide open
  double closing_angle_deg = 0.0;         // the same, closed
  double opening_spine_radius_mm = 0.0;   // of the circle of the spine tips, wide open
  double opening_spine_depth_mm = 0.0;    // of the tips below the palm, wide open
  double closing_height_mm = 0.0;         // palm to spine tips, closed
  double top_solid_margin_mm = 0.0;       // added to the palm's diameter on top of the mask
  double bottom_void_margin_mm = 0.0;     // taken off the radius of the void at the bottom
  std::optional<GripperFingers> fingers;  // none: forces are unknown
  Engagement engagement;
  ParameterRanges ranges;              // prior of the uncertain parameters
  std::vector<ParameterSet> ensemble;  // fitted to pull tests; empty: the prior holds

  // Throws Error naming the field, its value and the bound that it breaks, also between fields:
  // the closing angle lies below the opening angle.
  void check() const;
};

// The keys of a gripper file but those of its sections, bound to `gripper`.
void bind(libmap::ParameterTable& table, Gripper& gripper);

// Throws Error if the gripper has no `fingers`: forces need them.
void require_fingers(const Gripper& gripper);

// The uncertain parameters of a gripper with `fingers`, and a gripper with other ones.
ParameterValues parameters_of(const Gripper& gripper);
Gripper with_parameters(Gripper gripper, const ParameterValues& values);

// The sets over which forces are predicted: the fitted ensemble; else 64 sets of the prior, of
// equal weights, the same for the same file; without ranges the gripper's own parameters alone.
std::vector<ParameterSet> parameter_sets(const Gripper& gripper);

}  // namespace libgtd
