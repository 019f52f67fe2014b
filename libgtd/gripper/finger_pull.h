// Pull that the spines of one closed finger bear, as a function of the ground's fall under them.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Of ground that falls outward by -90 .. 90 degrees and of each parameter set: the largest force
// away from the ground that the finger bears, in closing forces; mean over draws of its spines.
// With spines that share the force in equal parts, a finger bears on its k steepest facets
//   min(P tan b / (1 - c tan b), k L sin b),  b = fall + psi_k + atan(friction) - 90 deg,
// where P is the closing force, L a spine's limit and c = sin g cos g / (1 + sin^2 g) on ground
// that falls by g if the drive holds (0 else), as in holding_force.h; the best k counts.
struct FingerPulls {
  std::size_t sets = 0;
  std::vector<float> pulls;         // at (fall + 90) * sets + set
  std::vector<float> pushes;        // of each set: the force that all its engaged spines bear
  std::vector<double> all_fingers;  // of each set: closing force of all fingers, N

  const float* at(int fall_deg) const {
    return &pulls[static_cast<std::size_t>(fall_deg + 90) * sets];
  }
};

// `gripper` must have `fingers`. The same for any number of threads.
FingerPulls finger_pulls(const Gripper& gripper, const std::vector<ParameterSet>& sets);

}  // namespace libgtd
