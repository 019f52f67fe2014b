// Dimensions and force parameters of a spined gripper (tab. 3-2 of the thesis).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"

namespace libgtd {

// Section `fingers` of a gripper file: parameters that forces and the virtual field test
// (libgtd/grasp) need in addition to the dimensions of the mask.
struct GripperFingers {
  int count = 0;                     // number of fingers, evenly around the palm's axis
  double curl_deg = 0.0;             // inward angle from proximal to distal link without contact
  double curl_limit_deg = 0.0;       // maximum inward angle if the ground stops the proximal link
  int spines_per_finger = 0;         // number of spines on the outer half of the distal link
  double spine_tip_radius_um = 0.0;  // radius of the rounded tip
  double spine_force_limit_n = 0.0;  // maximum force on one spine or the asperity below it
  double closing_force_n = 0.0;      // maximum force of one finger toward the palm's axis
  bool holds_when_closed = false;    // the drive resists any opening force, e.g. a ball screw

  // Throws Error naming key, value and bound.
  void check() const;
};

// Binds the keys "fingers.KEY" of a gripper file.
void bind(libmap::ParameterTable& table, GripperFingers& fingers);

// Section `engagement` of a gripper file. A spine that is dragged along the ground may meet a
// facet, which is inclined by a random angle psi against the drag; contacts have Coulomb friction
// (Asbeck et al. 2006; Chen et al. 2024, arXiv 2407.00973).
struct Engagement {
  double friction = 0.39;         // Coulomb friction coefficient of spines and links
  double asperity_min_deg = 0.0;  // psi is uniform between these bounds
  double asperity_max_deg = 90.0;
  double engagement_rate = 0.6;  // 1/mm; P(spine meets a facet) = 1 - exp(-rate * drag)
  double drag_mm = 5.0;          // path of a spine along the ground

  // Throws Error naming key, value and bound.
  void check() const;
};
// Binds the keys "engagement.KEY" of a gripper file.
void bind(libmap::ParameterTable& table, Engagement& engagement);

// Returns the fraction of spines that meet a facet. The rate is multiplied by u(r) / u(25), where r
// is spine_tip_radius_um and u(r) = 2.49 (r + 39.44)^-0.7116 - 0.01212 is the fraction of
// asperities that are usable for a tip of this radius (fitted to concrete, Chen et al. 2024).
double engagement_fraction(const Engagement& engagement, double spine_tip_radius_um);

// Number of uncertain parameters: spine_force_limit_n and closing_force_n of `fingers`; friction,
// asperity_min_deg, asperity_max_deg and engagement_rate of `engagement`; in this order.
constexpr std::size_t uncertain_parameters = 6;
using ParameterValues = std::array<double, uncertain_parameters>;
const std::array<std::string, uncertain_parameters>& uncertain_parameter_names();

// Bounds of a parameter's prior. Half of the probability is between `low` and the value in the
// gripper file, the other half between this value and `high`. In each half, angles are uniform;
// forces, friction and rate are uniform in the logarithm. If the value equals a bound, the prior is
// uniform from bound to bound.
struct ParameterRange {
  double low = 0.0;
  double high = 0.0;
};
// Section `ranges` of a gripper file. A parameter without a range is known exactly.
using ParameterRanges = std::array<std::optional<ParameterRange>, uncertain_parameters>;

// Returns the parameters at quantiles (0 .. 1) of the prior with the file's values `middle`.
ParameterValues prior_values(const ParameterRanges& ranges, const ParameterValues& middle,
                             const ParameterValues& quantiles);

struct ParameterSet {
  double weight = 1.0;  // weights of an ensemble sum to 1
  ParameterValues values{};
};

// Returns `count` vectors of quantiles of low discrepancy: the six-dimensional sequence of Roberts
// (2018), shifted by the seed.
std::vector<ParameterValues> low_discrepancy_quantiles(std::size_t count, std::uint64_t seed);

// Returns the index of the parameter set at `fraction` (0 .. 1) of the cumulative weights. Evenly
// spaced fractions select the sets in proportion to their weights.
std::size_t parameter_set_at(const std::vector<ParameterSet>& ensemble, double fraction);

// Dimensions (mm, degrees) and force parameters of a gripper.
struct Gripper {
  std::string name;
  double palm_diameter_mm = 0.0;
  double finger_joint_diameter_mm = 0.0;  // diameter of the circle of finger joints
  double finger_length_mm = 0.0;          // length of the proximal link: joint to spine carrier
  double spine_length_mm = 0.0;           // length of the distal link: spine carrier to spine tip
  double spine_depth_mm = 0.0;            // penetration of a spine into the ground
  double opening_angle_deg = 0.0;         // angle of a finger from the palm's axis, open
  double closing_angle_deg = 0.0;         // angle of a finger from the palm's axis, closed
  double opening_spine_radius_mm = 0.0;   // radius of the circle of spine tips, open
  double opening_spine_depth_mm = 0.0;    // depth of the spine tips below the palm, open
  double closing_height_mm = 0.0;         // depth of the spine tips below the palm, closed
  double top_solid_margin_mm = 0.0;       // added to the palm diameter at the top of the mask
  double bottom_void_margin_mm = 0.0;     // subtracted from the void radius at the bottom
  std::optional<GripperFingers> fingers;  // nullopt: forces are unknown
  Engagement engagement;
  ParameterRanges ranges;              // prior of the uncertain parameters
  std::vector<ParameterSet> ensemble;  // fitted to pull tests; empty: the prior is used

  // Throws Error naming field, value and bound if a value is out of range, or if values contradict
  // each other, for example a closing angle that is not below the opening angle.
  void check() const;
};

// Binds the keys of a gripper file that are outside sections.
void bind(libmap::ParameterTable& table, Gripper& gripper);

// Throws Error if the gripper has no `fingers`, which are required for forces.
void require_fingers(const Gripper& gripper);

// Return the uncertain parameters of a gripper with `fingers`, and a copy of it with other values.
ParameterValues parameters_of(const Gripper& gripper);
Gripper with_parameters(Gripper gripper, const ParameterValues& values);

// Returns the parameter sets for the prediction of forces: the fitted ensemble; if it is empty, 64
// equally weighted sets of the prior, the same in each call; without ranges, the file's values.
std::vector<ParameterSet> parameter_sets(const Gripper& gripper);

}  // namespace libgtd
