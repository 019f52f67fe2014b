// The form of one rock or climbing hold. Inner part of libmap/simulate.
#pragma once

#include "libmap/simulate/rock_site.h"
#include "libmap/simulate/solid.h"

namespace libmap {

// The rock in its own frame: the ground at its foot is z = 0, its top at height_m exactly; above
// the ground it is width_m long in x and depth_m in y, about the origin. It reaches down to about
// -sink_m (cobbles and holds: as their form has it). Labels are 0.
Solid rock_solid(const SiteRock& rock, double edge_length_m, double sink_m);

}  // namespace libmap
