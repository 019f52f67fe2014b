// Finds intersecting triangles of a mesh (CGAL's exact predicates).
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

using TrianglePair = std::pair<std::uint32_t, std::uint32_t>;

// Returns pairs (lower, higher index), ascending, of triangles that intersect in more than their
// common corners or edge (equal vertex indices). Excludes pairs with three common corners and
// triangles with exactly collinear corners. With `only` (one mark per triangle), at least one
// triangle of each pair is marked. Indices must be in range and vertices finite. The result does
// not depend on the number of threads.
std::vector<TrianglePair> find_self_intersections(const TriangleMesh& mesh,
                                                  const std::vector<bool>& only = {});

}  // namespace libmap
