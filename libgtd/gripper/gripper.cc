#include "libgtd/gripper/gripper.h"
#include "libmap/core/error.h"

#include <cmath>

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
  table.add("opening_angle_deg", gripper.opening_angle_deg, {0.0, 90.0, true, false},
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

void bind(libmap::ParameterTable& table, GripperFingers& fingers) {
  using libmap::positive;
  table.add("fingers.count", fingers.count, {1, 64}, "number of fingers");
  table.add("fingers.curl_deg", fingers.curl_deg, {0.0, 90.0},
            "angle of the distal link to the proximal one, inward, of a free finger");
  table.add("fingers.curl_limit_deg", fingers.curl_limit_deg, {0.0, 170.0},
            "the same at most, once the proximal link is stopped");
  table.add("fingers.spines_per_finger", fingers.spines_per_finger, {1, 1000},
            "spines of one finger");
  table.add("fingers.spine_tip_radius_um", fingers.spine_tip_radius_um, {0.0, 1000.0, true, false},
            "radius of a spine's tip, micrometers");
  table.add("fingers.spine_force_limit_n", fingers.spine_force_limit_n, positive,
            "largest force on one spine, N");
  table.add("fingers.closing_force_n", fingers.closing_force_n, positive,
            "force of one finger toward the palm's axis, N");
  table.add("fingers.holds_when_closed", fingers.holds_when_closed,
            "the drive resists any opening force");
}

void GripperFingers::check() const {
  libmap::check_parameters(*this);
  if (curl_limit_deg < curl_deg)
    throw libmap::Error("a stopped finger curls further than a free one",
                        {.field = "fingers.curl_limit_deg",
                         .value = libmap::to_text(curl_limit_deg),
                         .bound = ">= fingers.curl_deg, " + libmap::to_text(curl_deg)});
}

double HoldModel::probability(const ClosingTerms& terms) const {
  return 1.0 / (1.0 + std::exp(-(intercept + contact * terms.contact + bearing * terms.bearing -
                                 rise * terms.rise - depth * terms.depth)));
}

void bind(libmap::ParameterTable& table, HoldModel& model) {
  using libmap::not_negative;
  table.add("hold_model.load_n", model.load_n, libmap::positive, "pull that the model is for, N");
  table.add("hold_model.intercept", model.intercept, {-100.0, 100.0}, "logit without any term");
  table.add("hold_model.contact", model.contact, not_negative,
            "weight of the share of fingers whose spines meet the ground");
  table.add("hold_model.bearing", model.bearing, not_negative, "weight of what these bear");
  table.add("hold_model.rise", model.rise, not_negative,
            "weight of the palm's height above the voxel");
  table.add("hold_model.depth", model.depth, not_negative,
            "weight of the depth of the contacts below the palm");
}

}  // namespace libgtd
