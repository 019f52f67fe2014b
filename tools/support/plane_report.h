// What the user is told of a terrain's regression plane.
#pragma once

#include <string>

#include "libgtd/terrain/regression_plane.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// What decided which side is up, unless it was given; a warning where that was the frame's z axis
// and the relief says otherwise, as of a cloud in a camera's frame, whose z axis points into the
// ground.
void report_plane(const libgtd::RegressionPlane& plane, const std::string& terrain, Run& run);

}  // namespace graspmap_tools
