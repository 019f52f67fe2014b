// Triangle mesh of a test site.
#pragma once

#include <cstdint>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/solid.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// Solid of a rock in the rock frame: the ground is z = 0, the top is at height_m exactly. Above the
// ground, the extent is width_m in x and depth_m in y, centered on the origin. The solid extends
// down to about z = -sink_m; for cobbles and holds, the shape sets the lowest z. All labels are 0.
Solid rock_solid(const SiteRock& rock, double edge_length_m, double sink_m);

struct SiteMeshOptions {
  double edge_length_m = 0.008;  // approximate; small rocks and holds have shorter edges
  bool closed = false;           // include the sides and the base of the ground
  std::uint64_t max_triangles = 10'000'000;  // limit of the estimated number
};

// Union of rocks and ground (CGAL) in the site frame, with vertex colors and the face field "rock":
// 0 on the ground, n on the n-th rock. The open mesh is one surface with the outline of the ground
// as its only border; the closed mesh is the surface of one solid. Throws Error if an option or the
// site is invalid, there are more than max_triangles, or a rock does not touch the ground.
TriangleMesh site_mesh(const RockSite& site, const SiteMeshOptions& options);

}  // namespace libmap
