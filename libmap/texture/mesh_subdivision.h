// Subdivides long triangles of a mesh without changing the surface. Private to libmap/texture.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct SubdivisionResult {
  TriangleMesh mesh;
  double max_side_m = 0.0;            // maximum side length that was used
  std::vector<std::uint32_t> source;  // index of the input triangle, one per triangle
};

// Returns true if a triangle with a long side must be subdivided. Called from several threads.
using NeedsCutting = std::function<bool(const TriangleMesh& mesh, const Triangle& triangle)>;

// Halves sides longer than `max_side_m`, in all adjacent triangles, until no triangle that needs
// cutting has such a side. Indices and positions of existing vertices are kept. If the result would
// exceed both `max_triangles` and twice the input's triangles, a larger side length is used. Vertex
// values are interpolated; parts of a triangle inherit the face fields.
SubdivisionResult split_long_sides(
    TriangleMesh mesh, double max_side_m, std::uint64_t max_triangles,
    const NeedsCutting& needs_cutting = [](const TriangleMesh&, const Triangle&) { return true; });

}  // namespace libmap
