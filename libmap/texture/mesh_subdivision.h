// Finer triangles on the same surface. Private to libmap/texture.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct SubdivisionResult {
  TriangleMesh mesh;
  double max_side_m = 0.0;            // what was aimed at in the end
  std::vector<std::uint32_t> source;  // of each triangle: the one that it is a part of
};

// Whether a triangle with a long side, or parts of it, need to be cut. Asked from several threads.
using NeedsCutting = std::function<bool(const TriangleMesh& mesh, const Triangle& triangle)>;

// Halves sides longer than `max_side_m`, on all of their triangles, until no triangle that needs it
// has one; vertices that there were keep their places. Where that would make more than
// `max_triangles`, and more than twice those of the mesh, a longer side is aimed at. Values at new
// vertices are interpolated, parts of a triangle have its fields.
SubdivisionResult split_long_sides(
    TriangleMesh mesh, double max_side_m, std::uint64_t max_triangles,
    const NeedsCutting& needs_cutting = [](const TriangleMesh&, const Triangle&) { return true; });

}  // namespace libmap
