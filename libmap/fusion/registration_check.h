// Registration of frames, accepted or rejected by measurements that it has not used. Inner part of
// depth_fusion.
#pragma once

#include <cstddef>
#include <span>

#include "libmap/fusion/fusion_frames.h"

namespace libmap {

// Mean costs of one kind of measurements by the poses before and after a registration.
struct PairCosts {
  std::size_t count = 0;
  double before = 0.0;
  double after = 0.0;
  double deviation = 0.0;  // standard error of after - before, between pairs of frames

  // By more than two standard errors and half a percent.
  bool is_clearly_worse() const;
  bool is_clearly_better() const;
};

struct RegistrationCheck {
  PairCosts depth;  // in the held-out squares of the plan
  PairCosts color;  // everywhere: registration uses depth only

  // No kind is clearly worse and both together are better. Refined poses have used depth already:
  // color must be clearly better.
  bool is_accepted(bool refined_poses) const;
};

// Compares up to 72 pairs of overlapping frames by their poses before and after a registration.
RegistrationCheck check_registration(FusionFrames& images, std::span<const FusionFrame> before,
                                     std::span<const FusionFrame> after, const DepthSensor& sensor,
                                     double voxel_size_m);

}  // namespace libmap
