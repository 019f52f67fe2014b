// The way of closing fingers over a map, and the pull that the spines of one of them bear as a
// function of the ground's fall under it.
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
  std::vector<float> pulls;    // at (fall + 90) * sets + set
  std::vector<float> pushes;   // of each set: the force that all its engaged spines bear
  std::vector<float> spreads;  // of each set: deviation of a pull on level ground over its mean
  std::vector<double> all_fingers;  // of each set: closing force of all fingers, N

  const float* at(int fall_deg) const {
    return &pulls[static_cast<std::size_t>(fall_deg + 90) * sets];
  }
};

// `gripper` must have `fingers`. The same for any number of threads.
FingerPulls finger_pulls(const Gripper& gripper, const std::vector<ParameterSet>& sets);

// The way of a closing finger over voxel columns, which method `calibrated` follows on a map:
// places of the finger's parts relative to the palm. A finger turns from wide open to closed in
// steps that move its tip by at most half a voxel; its places are the tip, the middle of the distal
// link and the knuckle, in this order at each step.
struct ClosingPath {
  struct Place {
    double radius_m = 0.0;  // from the palm's axis
    double depth_m = 0.0;   // below the palm
    bool has_spines = false;
  };
  std::vector<Place> closing;
  std::vector<Place> open;  // of the open finger, from joint to tip
  double palm_radius_m = 0.0;
  double finger_length_m = 0.0;    // both links
  double load_n = 0.0;             // whose hold probability is asked for
  std::vector<ParameterSet> sets;  // over which forces are predicted
  FingerPulls pulls;               // of these
  FingerPulls reference;           // of the gripper file's own parameters

  double reach_m() const;  // the largest radius
};

// Throws Error if the gripper has no `fingers`.
ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m, double load_n);

}  // namespace libgtd
