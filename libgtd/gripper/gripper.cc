#include "libgtd/gripper/gripper.h"

namespace libgtd {

namespace {

constexpr libmap::Range angle{0.0, 90.0, true, true};

}  // namespace

void bind(libmap::ParameterTable& table, Gripper& gripper) {
  using libmap::not_negative;
  using libmap::positive;
  table.add("name", gripper.name, "name of the gripper");
  table.add("palm_diameter_mm", gripper.palm_diameter_mm, positive, "diameter of the palm");
  table.add("finger_joint_diameter_mm", gripper.finger_joint_diameter_mm, positive,
            "diameter of the circle of the finger joints");
  table.add("finger_length_mm", gripper.finger_length_mm, positive,
            "length of a finger, joint to spine carrier");
  table.add("spine_length_mm", gripper.spine_length_mm, positive,
            "length of a spine, carrier to tip");
  table.add("spine_depth_mm", gripper.spine_depth_mm, not_negative,
            "depth of a spine in the ground");
  table.add("opening_angle_deg", gripper.opening_angle_deg, angle,
            "angle of a finger to the palm's axis, wide open");
  table.add("closing_angle_deg", gripper.closing_angle_deg, angle,
            "angle of a finger to the palm's axis, closed");
  table.add("opening_spine_radius_mm", gripper.opening_spine_radius_mm, positive,
            "radius of the circle of the spine tips, wide open");
  table.add("opening_spine_depth_mm", gripper.opening_spine_depth_mm, not_negative,
            "depth of the spine tips below the palm, wide open");
  table.add("closing_height_mm", gripper.closing_height_mm, positive,
            "height of the palm above the spine tips, closed");
  table.add("top_solid_margin_mm", gripper.top_solid_margin_mm, not_negative,
            "margin of the diameter of the solid disc on top of the mask");
  table.add("bottom_void_margin_mm", gripper.bottom_void_margin_mm, not_negative,
            "margin of the radius of the void at the bottom of the mask");
}

void Gripper::check() const {
  libmap::check_parameters(*this);
  if (fingers) fingers->check();
  if (closing_angle_deg >= opening_angle_deg)
    throw libmap::Error("the fingers close inward",
                        {.field = "closing_angle_deg",
                         .value = libmap::to_text(closing_angle_deg),
                         .bound = "< opening_angle_deg, " + libmap::to_text(opening_angle_deg)});
}

}  // namespace libgtd
