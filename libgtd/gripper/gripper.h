// The measures of a spined gripper (tab. 3-2 of the thesis), as its makers give them.
#pragma once

#include <optional>
#include <string>

#include "libmap/core/parameters.h"

namespace libgtd {

// What the open and closing fingers meet around a voxel of a map; see libgtd/score/closing_terms.h.
struct ClosingTerms {
  double contact = 0.0;  // share of the azimuths, on the weakest side, where spines meet the ground
  double bearing = 0.0;  // ln(1 + F / P) of the pull F that they bear there, on the weakest side
  double rise = 0.0;     // of the palm above the voxel, in lengths of a finger
  double depth = 0.0;    // of the contacts below the palm, mean, in lengths of a finger
};

// The section `hold_model` of a gripper file, which method `calibrated` needs: the probability that
// the gripper holds. Logistic regression: ln(p / (1 - p)) = intercept + contact * C + bearing * B -
// rise * R - depth * D, fitted to verdicts of the virtual field test for one load. More contact and
// more bearing never lower the probability, more rise and depth never raise it.
struct HoldModel {
  double load_n = 0.0;
  double intercept = 0.0;
  double contact = 0.0;
  double bearing = 0.0;
  double rise = 0.0;
  double depth = 0.0;

  // In 0 .. 1, that the load is held.
  double probability(const ClosingTerms& terms) const;
};

// The keys "hold_model.KEY" of a gripper file, bound to `model`.
void bind(libmap::ParameterTable& table, HoldModel& model);

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
  std::optional<GripperFingers> fingers;  // none: there is no virtual field test of it
  std::optional<HoldModel> hold_model;    // none: method `calibrated` is not for it

  // Throws Error naming the field, its value and the bound that it breaks, also between fields:
  // the closing angle lies below the opening angle.
  void check() const;
};

// The keys of a gripper file but those of its sections, bound to `gripper`.
void bind(libmap::ParameterTable& table, Gripper& gripper);

}  // namespace libgtd
