// Cutting a set of triangles into an oriented manifold (Gueziec, Taubin, Lazarus, Horn 2001,
// "Cutting and stitching: converting sets of polygons to manifold surfaces", cutting).
#pragma once

#include <cstddef>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct ManifoldCuts {
  std::size_t edges = 0;     // cut: of more than two triangles, or where the surface is one-sided
  std::size_t vertices = 0;  // copies made
  std::size_t turned = 0;    // triangles
  std::size_t dropped = 0;   // triangles that no cut sets free: they fold back on their own edge
};

// At an edge of more than two triangles, those that run along it in opposite senses stay joined in
// pairs, the straightest pair first; the others are cut off. Each component is oriented as most of
// its area was; where that is not possible (a Moebius strip) it is cut. Then each fan of triangles
// at a vertex gets a vertex of its own: the largest fan keeps the vertex, the copies of the others,
// at the end of the vertices, move towards the middle of their fan, so that the sheets no longer
// touch: by 1 % of the way, or by `min_gap_m`, but by no more than half of it. Triangles keep their
// order. No triangle may name a vertex twice.
ManifoldCuts make_manifold(TriangleMesh& mesh, double min_gap_m = 0.0);

// Each edge has at most two triangles, in opposite senses, each vertex one fan.
bool is_oriented_manifold(const TriangleMesh& mesh);

}  // namespace libmap
