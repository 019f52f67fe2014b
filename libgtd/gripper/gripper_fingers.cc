#include "libgtd/gripper/gripper_fingers.h"

#include "libmap/core/error.h"

namespace libgtd {

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

}  // namespace libgtd
