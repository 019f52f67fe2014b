// The measures of a spined gripper (tab. 3-2 of the thesis), as its makers give them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libgtd/gripper/engagement.h"
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
