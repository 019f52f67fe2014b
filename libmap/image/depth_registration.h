// Depth images of one camera as another one would have taken them.
#pragma once

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// Each measurement covers the pixels of `target` on which its own pixel falls, the nearest one
// where several do; pixels that the depth camera cannot see stay without depth.
DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera);

}  // namespace libmap
