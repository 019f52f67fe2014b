// The way of a closing finger over voxel columns: what method `calibrated` follows on a map.
#pragma once

#include <array>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Of a finger's parts, relative to the palm. A finger turns from wide open to closed in steps that
// move its tip by at most half a voxel; its places are the tip, the middle of the distal link and
// the knuckle, in this order at each step.
struct ClosingPath {
  struct Place {
    double radius_m = 0.0;  // from the palm's axis
    double depth_m = 0.0;   // below the palm
    bool has_spines = false;
  };
  std::vector<Place> closing;
  std::vector<Place> open;  // of the open finger, from joint to tip
  double palm_radius_m = 0.0;
  double finger_length_m = 0.0;  // both links
  // ln(1 + F / P) of a finger of closing force P on ground that falls outward by -90 .. 90 degrees:
  // F is the mean over the leans psi of facets, uniform in 0 .. 90 degrees, of
  // min(P tan(fall + psi + phi - 90 deg), what all its spines bear), phi = atan 0.39 (Chen et al.
  // 2024).
  std::array<double, 181> bearing{};
  HoldModel model;

  double reach_m() const;  // the largest radius
};

// Throws Error naming the section that the gripper does not have: `fingers` or `hold_model`.
void require_hold_model(const Gripper& gripper);

// Throws as require_hold_model.
ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m);

}  // namespace libgtd
