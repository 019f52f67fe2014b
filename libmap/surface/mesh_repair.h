// Repair of triangles: vertices that coincide, triangles without area, and edges and vertices that
// are not manifold.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Throws Error: arrays that do not fit, an index out of range, a vertex that is not finite or
// farther than 1e30 m from the origin.
void require_sound(const TriangleMesh& mesh);

// Diagonal of the bounding box of the vertices that triangles use, m.
double size_of(const TriangleMesh& mesh);

// Twice the area over the longest side, m: 0 of a triangle that names a vertex twice.
double lowest_height(const TriangleMesh& mesh, const Triangle& triangle);

// Triangles lower than this share of size_of() count as degenerate.
constexpr double degenerate_height = 1e-9;
std::vector<bool> degenerate_triangles(const TriangleMesh& mesh);

// Each vertex, in its order, is made one with the first before it that is not farther than
// `distance_m` and was kept: those that are kept are farther from each other. Triangles then name
// those alone; the vertices stay. How many were joined to another.
std::size_t weld_vertices(TriangleMesh& mesh, double distance_m);

// For each triangle whether an earlier one has the same three vertices, in any order.
std::vector<bool> repeated_triangles(const std::vector<Triangle>& triangles);

// A degenerate triangle whose corners are apart has one on the opposite edge: that edge is turned
// towards the corner of the triangle beyond, or the triangle dropped where there is none. For
// oriented manifolds. How many were settled; those whose new edge exists already, and rows of caps
// that hang together with nothing else, are left.
std::size_t flip_caps(TriangleMesh& mesh);

struct ManifoldCuts {
  std::size_t edges = 0;     // cut: of more than two triangles, or where the surface is one-sided
  std::size_t vertices = 0;  // copies made
  std::size_t turned = 0;    // triangles
  std::size_t dropped = 0;   // triangles that no cut sets free: they fold back on their own edge
};

// Cuts a set of triangles into an oriented manifold (Gueziec, Taubin, Lazarus, Horn 2001, "Cutting
// and stitching: converting sets of polygons to manifold surfaces", cutting).
//
// At an edge of more than two triangles, those that run along it in opposite senses stay joined in
// pairs, the straightest pair first; the others are cut off. Each component is oriented as most of
// its area was; where that is not possible (a Moebius strip) it is cut. Then each fan of triangles
// at a vertex gets a vertex of its own: the largest fan keeps the vertex, the copies of the others,
// at the end of the vertices, move towards the middle of their fan, so that the sheets no longer
// touch: by 1 % of the way, or by `min_gap_m`, but by no more than half of it. Triangles keep their
// order. No triangle may name a vertex twice.
ManifoldCuts make_manifold(TriangleMesh& mesh, double min_gap_m = 0.0);

}  // namespace libmap
