// Gripper model of method `calibrated`: the path of a closing finger over the voxel columns of a
// map, and the pull that the spines bear as a function of the slope of the ground.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Largest force away from the ground that a finger bears, in units of the closing force P, for each
// parameter set and for ground that falls outward by g = -90 .. 90 degrees; mean over draws of the
// facets of the finger's spines. Spines share the force in equal parts. With the k steepest facets
// a finger bears
//   min(P tan b / (1 - c tan b), k L sin b),  b = g + psi_k + atan(friction) - 90 deg,
// where psi_k is the inclination of the k-th facet, L the force limit of a spine and c = sin g cos
// g / (1 + sin^2 g) if the drive resists opening (else 0), as in holding_force.h. The maximum over
// k counts.
struct FingerPulls {
  std::size_t sets = 0;
  std::vector<float> pulls;             // index: (fall + 90) * sets + set; see at()
  std::vector<float> max_spine_forces;  // per set: mean force that all engaged spines can bear
  std::vector<float> level_spreads;  // per set: standard deviation / mean of a pull on level ground
  std::vector<double> total_closing_forces_n;  // per set: closing force of all fingers, N

  const float* at(int fall_deg) const {  // pulls of all sets for a fall of -90 .. 90
    return &pulls[static_cast<std::size_t>(fall_deg + 90) * sets];
  }
};

// Computes the pulls of a gripper with `fingers`. The result does not depend on the number of
// threads.
FingerPulls finger_pulls(const Gripper& gripper, const std::vector<ParameterSet>& sets);

// Path of a closing finger over voxel columns for method `calibrated`: positions of finger parts
// relative to the palm. The finger turns from open to closed in steps that move the tip by at most
// half a voxel. Each step has three positions: tip, middle of the distal link, knuckle.
struct ClosingPath {
  struct PathPoint {
    double radius_m = 0.0;  // from the palm's axis
    double depth_m = 0.0;   // below the palm
    bool has_spines = false;
  };
  std::vector<PathPoint> closing;
  std::vector<PathPoint> open;  // the open finger, from joint to tip
  double palm_radius_m = 0.0;
  double finger_length_m = 0.0;    // both links
  double load_n = 0.0;             // load of the hold probability, N
  std::vector<ParameterSet> sets;  // parameter sets of the prediction
  FingerPulls pulls;               // for `sets`
  FingerPulls nominal_pulls;       // for the parameters of the gripper file

  double reach_m() const;  // maximum radius of all positions
};

// Computes the path. Throws Error if the gripper has no `fingers`.
ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m, double load_n);

}  // namespace libgtd
