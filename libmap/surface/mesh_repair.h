// Repairs a mesh: merges coincident vertices, finds triangles without area, and cuts non-manifold
// edges and vertices. Steps of mesh_cleaning.h.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Throws Error if array sizes are inconsistent, an index is out of range, or a vertex is not finite
// or has a coordinate beyond +-1e30 m.
void require_sound(const TriangleMesh& mesh);

// Returns the diagonal of the bounding box of all vertices that triangles use, m.
double size_of(const TriangleMesh& mesh);

// Returns a triangle's smallest height (2 area / longest side), m; 0 for a repeated vertex.
double lowest_height(const TriangleMesh& mesh, const Triangle& triangle);

// Returns for each triangle true if lowest_height <= degenerate_height * size_of(mesh).
constexpr double degenerate_height = 1e-9;
std::vector<bool> degenerate_triangles(const TriangleMesh& mesh);

// Replaces each vertex, in order, by the first earlier kept vertex within `distance_m`; kept
// vertices are farther apart. Changes only the triangles. Returns the number of replaced vertices.
std::size_t weld_vertices(TriangleMesh& mesh, double distance_m);

// Returns for each triangle true if an earlier triangle has the same vertices, in any order.
std::vector<bool> repeated_triangles(const std::vector<Triangle>& triangles);

// Removes caps (degenerate triangles with a corner on the opposite edge) from an oriented manifold:
// flips this edge, or drops the cap if the edge belongs to no other triangle. Keeps a cap if the
// new edge exists, or the edge's other triangle is a kept cap. Returns the number of removed caps.
std::size_t flip_caps(TriangleMesh& mesh);

struct ManifoldCuts {
  std::size_t edges = 0;     // cut edges: more than two triangles, or a one-sided surface
  std::size_t vertices = 0;  // new copies of vertices, one per additional fan of triangles
  std::size_t turned = 0;    // triangles with reversed orientation
  std::size_t dropped = 0;   // removed triangles at edges that cuts cannot make manifold
};

// Cuts a set of triangles into an oriented manifold (Gueziec, Taubin, Lazarus, Horn 2001, "Cutting
// and stitching: converting sets of polygons to manifold surfaces", cutting).
//
// At an edge of more than two triangles, triangles of opposite directions stay joined in pairs, the
// straightest pair first; the others are cut off. Each component takes the orientation of most of
// the component's area and is cut where no orientation exists (Moebius strip). Then each fan of
// triangles at a vertex gets a separate vertex. The largest fan keeps the original. The copies for
// the other fans are appended. So that the sheets do not touch, a copy is moved towards the fan's
// center by 1 % of the distance or by `min_gap_m` (the maximum, but at most half of the distance).
// The order of triangles is kept. No triangle may have a repeated vertex.
ManifoldCuts make_manifold(TriangleMesh& mesh, double min_gap_m = 0.0);

}  // namespace libmap
