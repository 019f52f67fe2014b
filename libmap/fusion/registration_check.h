// Validates a registration of frames by held-out measurements. Private to depth_fusion.
#pragma once

#include <span>

#include "libmap/fusion/depth_fusion.h"
#include "libmap/fusion/fusion_frames.h"

namespace libmap {

// Returns the costs of up to 72 pairs of overlapping frames with the poses of `before` and `after`.
RegistrationCheck check_registration(FusionFrames& images, std::span<const FusionFrame> before,
                                     std::span<const FusionFrame> after, const DepthSensor& sensor,
                                     double voxel_size_m);

}  // namespace libmap
