#include "libgtd/gripper/gripper.h"

#include <algorithm>
#include <tuple>

#include "libmap/core/error.h"

namespace libgtd {

namespace {

constexpr libmap::Range angle{0.0, 90.0, true, true};

}  // namespace

void bind(libmap::ParameterTable& table, Gripper& gripper) {
  using libmap::not_negative;
  using libmap::positive;
  table.add("name", gripper.name, "name of the gripper");
  table.add("palm_diameter_mm", gripper.palm_diameter_mm, positive, "diameter of the palm, mm");
  table.add("finger_joint_diameter_mm", gripper.finger_joint_diameter_mm, positive,
            "diameter of the circle through the finger joints, mm");
  table.add("finger_length_mm", gripper.finger_length_mm, positive,
            "length of a finger from its joint to the spine carrier, mm");
  table.add("spine_length_mm", gripper.spine_length_mm, positive,
            "length of a spine from its carrier to its tip, mm");
  table.add("spine_depth_mm", gripper.spine_depth_mm, not_negative,
            "depth to which a spine penetrates the ground, mm");
  table.add("opening_angle_deg", gripper.opening_angle_deg, {0.0, 90.0, true, false},
            "angle between an open finger and the palm's axis, degrees");
  table.add("closing_angle_deg", gripper.closing_angle_deg, angle,
            "angle between a closed finger and the palm's axis, degrees");
  table.add("opening_spine_radius_mm", gripper.opening_spine_radius_mm, positive,
            "radius of the circle through the spine tips of the open gripper, mm");
  table.add("opening_spine_depth_mm", gripper.opening_spine_depth_mm, not_negative,
            "depth of the spine tips of the open gripper below the palm, mm");
  table.add("closing_height_mm", gripper.closing_height_mm, positive,
            "height of the palm of the closed gripper above the spine tips, mm");
  table.add("top_solid_margin_mm", gripper.top_solid_margin_mm, not_negative,
            "margin added to the diameter of the solid disc at the top of the mask, mm");
  table.add("bottom_void_margin_mm", gripper.bottom_void_margin_mm, not_negative,
            "margin subtracted from the radius of the void at the bottom of the mask, mm");
}

void Gripper::check() const {
  libmap::check_parameters(*this);
  if (fingers) fingers->check();
  engagement.check();
  if (closing_angle_deg >= opening_angle_deg)
    throw libmap::Error("fingers would not close inward",
                        {.field = "closing_angle_deg",
                         .value = libmap::to_text(closing_angle_deg),
                         .bound = "< opening_angle_deg = " + libmap::to_text(opening_angle_deg)});
}

void bind(libmap::ParameterTable& table, GripperFingers& fingers) {
  using libmap::positive;
  table.add("fingers.count", fingers.count, {1, 64}, "number of fingers");
  table.add(
      "fingers.curl_deg", fingers.curl_deg, {0.0, 90.0},
      "inward angle from the proximal to the distal link of a finger without contact, degrees");
  table.add(
      "fingers.curl_limit_deg", fingers.curl_limit_deg, {0.0, 170.0},
      "maximum inward angle of the distal link after the ground stops the proximal link, degrees");
  table.add("fingers.spines_per_finger", fingers.spines_per_finger, {1, 1000},
            "number of spines per finger");
  table.add("fingers.spine_tip_radius_um", fingers.spine_tip_radius_um, {0.0, 1000.0, true, false},
            "radius of a spine's tip, micrometers");
  table.add("fingers.spine_force_limit_n", fingers.spine_force_limit_n, positive,
            "maximum force on one spine, N");
  table.add("fingers.closing_force_n", fingers.closing_force_n, positive,
            "closing force of one finger toward the palm's axis, N");
  table.add("fingers.holds_when_closed", fingers.holds_when_closed,
            "true if the drive resists any force that opens the fingers");
}

void GripperFingers::check() const {
  libmap::check_parameters(*this);
  if (curl_limit_deg < curl_deg)
    throw libmap::Error("less than the curl of a finger without contact",
                        {.field = "fingers.curl_limit_deg",
                         .value = libmap::to_text(curl_limit_deg),
                         .bound = ">= fingers.curl_deg = " + libmap::to_text(curl_deg)});
}

void require_fingers(const Gripper& gripper) {
  if (!gripper.fingers)
    throw libmap::Error(
        "is missing: forces require this section of the gripper file; method corrected does not",
        {.field = "fingers"});
}

ParameterValues parameters_of(const Gripper& gripper) {
  const Engagement& engagement = gripper.engagement;
  return {gripper.fingers->spine_force_limit_n,
          gripper.fingers->closing_force_n,
          engagement.friction,
          engagement.asperity_min_deg,
          engagement.asperity_max_deg,
          engagement.engagement_rate};
}

Gripper with_parameters(Gripper gripper, const ParameterValues& values) {
  std::tie(gripper.fingers->spine_force_limit_n, gripper.fingers->closing_force_n,
           gripper.engagement.friction, gripper.engagement.asperity_min_deg,
           gripper.engagement.asperity_max_deg, gripper.engagement.engagement_rate) =
      std::tuple_cat(values);
  return gripper;
}

std::vector<ParameterSet> parameter_sets(const Gripper& gripper) {
  if (!gripper.ensemble.empty()) return gripper.ensemble;
  const ParameterValues middle = parameters_of(gripper);
  const bool is_known = std::none_of(gripper.ranges.begin(), gripper.ranges.end(),
                                     [](const auto& range) { return range.has_value(); });
  if (is_known) return {{.weight = 1.0, .values = middle}};
  constexpr std::size_t count = 64;
  constexpr std::uint64_t seed = 1;
  std::vector<ParameterSet> sets;
  for (const ParameterValues& quantiles : low_discrepancy_quantiles(count, seed))
    sets.push_back(
        {.weight = 1.0 / count, .values = prior_values(gripper.ranges, middle, quantiles)});
  return sets;
}

}  // namespace libgtd
