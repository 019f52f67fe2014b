// The section `fingers` of a gripper file: what the virtual field test (libgtd/grasp) needs beyond
// the measures of the mask.
#pragma once

#include "libmap/core/parameters.h"

namespace libgtd {

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

}  // namespace libgtd
