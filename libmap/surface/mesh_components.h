// Components of a mesh whose adjacency is known.
#pragma once

#include <vector>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

// connected_components(mesh) by `opposite`, its half-edges (opposites_of): a hash table of all
// edges takes three times as long.
MeshComponents components_of(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite);

}  // namespace libmap
