// Vertices that are one, and triangles that are none.
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

}  // namespace libmap
