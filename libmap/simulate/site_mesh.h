// Makes the triangle mesh of a test site.
#pragma once

#include <cstdint>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/solid.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// Returns a rock as solid in the rock frame: the ground is z = 0, the top is z = height_m. Above
// the ground, it extends by width_m in x and depth_m in y, centered on the origin. It extends down
// to about z = -sink_m; for cobbles and holds, the shape sets the lowest z. Solid::labels are 0.
Solid rock_solid(const SiteRock& rock, double edge_length_m, double sink_m);

struct SiteMeshOptions {
  double edge_length_m = 0.008;  // approximate; small rocks and holds have shorter edges
  bool closed = false;           // true: the mesh includes the sides and the base of the ground
  std::uint64_t max_triangles = 10'000'000;  // maximum number of triangles, estimated beforehand
};

// Unites rocks and ground (CGAL) in the site frame, with vertex colors and the face field "rock": 0
// on the ground, n on the n-th rock. The open mesh is one surface with the outline of the ground as
// its only border; the closed mesh is the surface of one solid. Throws Error if an option or the
// site is invalid, there are more than max_triangles, or a rock does not touch the ground.
TriangleMesh site_mesh(const RockSite& site, const SiteMeshOptions& options);

}  // namespace libmap
