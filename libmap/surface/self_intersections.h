// Triangles of a mesh that run through each other (CGAL's exact predicates).
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

using TrianglePair = std::pair<std::uint32_t, std::uint32_t>;

// Pairs (lower, higher), ascending, of triangles that meet in more than the corners or the edge
// which they share by index; pairs that share all three corners are not looked at, nor triangles
// whose corners lie on one line exactly. If `only` is not empty, one of each pair has its mark.
// Indices must be in range and vertices finite. The same for any number of threads.
std::vector<TrianglePair> find_self_intersections(const TriangleMesh& mesh,
                                                  const std::vector<bool>& only = {});

}  // namespace libmap
