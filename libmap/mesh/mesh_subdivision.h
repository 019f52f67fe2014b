// Finer triangles on the same surface. Inner part of libmap/mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct SubdivisionResult {
  TriangleMesh mesh;
  double max_side_m = 0.0;            // what was aimed at
  std::vector<std::uint32_t> source;  // of each triangle: the one that it is a part of
};

// Halves sides longer than `max_side_m`, on both of their triangles, until there are none; vertices
// that there were keep their places. Where that would make more than `most_triangles` a longer side
// is aimed at. Values at new vertices are interpolated, parts of a triangle have its fields.
SubdivisionResult split_long_sides(const TriangleMesh& mesh, double max_side_m,
                                   std::uint64_t most_triangles = 10'000'000);

}  // namespace libmap
