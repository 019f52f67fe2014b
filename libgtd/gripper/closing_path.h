// Gripper model of method `calibrated`: the path of a closing finger over the voxel columns of a
// map, and the pull that the spines bear as a function of the slope of the ground.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Largest force away from the ground that the spines of a finger bear, per parameter set, for
// ground that falls outward by g = -90 .. 90 degrees. Forces are divided by the closing force P.
// Value: mean of max_k f_k over random draws of the facets that the spines meet. The k steepest
// facets bear equal parts of
//   f_k = min(tan b / (1 - c tan b), k L sin b),  b = g + psi_k + atan(friction) - 90 deg.
// f_k is 0 for b <= 0 and k L for b >= 90 deg; psi_k is the inclination of the k-th facet, and L
// the force limit of a spine. c = sin g cos g / (1 + sin^2 g) for g > 0 if the drive resists
// opening (holding_force.h), else 0.
struct FingerPulls {
  std::size_t sets = 0;
  std::vector<float> pulls;             // index: (g + 90) * sets + set; see at()
  std::vector<float> max_spine_forces;  // per set: L * mean number of engaged spines
  std::vector<float> level_spreads;  // per set: standard deviation / mean of a pull on level ground
  std::vector<double> total_closing_forces_n;  // per set: closing force of all fingers, N

  const float* at(int fall_deg) const {  // pulls of all sets for a fall g
    return &pulls[static_cast<std::size_t>(fall_deg + 90) * sets];
  }
};

// Computes the pulls of a gripper with `fingers`, independent of the number of threads.
FingerPulls finger_pulls(const Gripper& gripper, const std::vector<ParameterSet>& sets);

// Path of a closing finger over voxel columns for method `calibrated`: positions of finger parts
// relative to the palm. The finger turns from open to closed in steps that move the tip by at most
// half a voxel. Each step has three positions: tip, middle of the distal link, knuckle.
struct ClosingPath {
  struct PathPoint {
    double radius_m = 0.0;    // distance from the palm's axis
    double depth_m = 0.0;     // depth below the palm
    bool has_spines = false;  // true on the distal link
  };
  std::vector<PathPoint> closing;
  std::vector<PathPoint> open;  // the open finger, from joint to tip
  double palm_radius_m = 0.0;
  double finger_length_m = 0.0;    // length of both links
  double load_n = 0.0;             // load of the hold probability, N
  std::vector<ParameterSet> sets;  // parameter sets of the prediction
  FingerPulls pulls;               // for `sets`
  FingerPulls nominal_pulls;       // for the parameters of the gripper file

  double reach_m() const;  // maximum radius of all positions
};

// Computes the path. Throws Error if the gripper has no `fingers`.
ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m, double load_n);

}  // namespace libgtd
