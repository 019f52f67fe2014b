// The measures of a spined gripper (tab. 3-2 of the thesis), as its makers give them.
#pragma once

#include <optional>
#include <string>

#include "libgtd/gripper/gripper_fingers.h"
#include "libgtd/gripper/hold_model.h"
#include "libmap/core/parameters.h"

namespace libgtd {

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
