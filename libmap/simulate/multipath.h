// Light that reaches a time-of-flight camera by way of a second surface. Inner part of
// sensor_faults.
#pragma once

#include "libmap/core/pose.h"
#include "libmap/simulate/depth_camera.h"

namespace libmap {

// Ranges of the view with what diffuse surfaces of this reflectance (0 to 1) mirror onto each
// other: light of the camera that meets one surface, then a second one, arrives later than the
// direct light of the second, and the camera measures the mean of both by their strength (the limit
// of paths that differ by little of the modulation's wavelength: Fuchs 2010). Concave edges become
// round and move away; flat and convex surfaces stay. One reflection, on a grid of pixels,
// interpolated.
void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance);

}  // namespace libmap
