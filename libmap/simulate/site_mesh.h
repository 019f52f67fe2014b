// A test site as triangles.
#pragma once

#include <cstdint>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/solid.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// The rock in its own frame: the ground at its foot is z = 0, its top at height_m exactly; above
// the ground it is width_m long in x and depth_m in y, about the origin. It reaches down to about
// -sink_m (cobbles and holds: as their form has it). Labels are 0.
Solid rock_solid(const SiteRock& rock, double edge_length_m, double sink_m);

struct SiteMeshOptions {
  double edge_length_m = 0.008;              // about; small rocks and holds are meshed finer
  bool closed = false;                       // with the sides and the base of the ground's block
  std::uint64_t max_triangles = 10'000'000;  // more is an Error
};

// Rocks united with the ground (CGAL), in the site's frame, with vertex colors and the face field
// "rock": 0 on the ground, n on the n-th rock. Open, it is one surface without holes but its
// outline, the ground's; closed, the surface of one solid.
// Throws Error: a bad option or site, too many triangles, a rock that does not touch the ground.
TriangleMesh site_mesh(const RockSite& site, const SiteMeshOptions& options);

}  // namespace libmap
