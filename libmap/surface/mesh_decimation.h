// Fewer triangles within an error bound that is proved afterwards.
#pragma once

#include <cstddef>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct MeshDecimation {
  std::size_t removed_triangles = 0;
  // No point of either surface is farther than this from the other; not above the bound asked for.
  double deviation_m = 0.0;
};

// Edges are collapsed into one of their ends (OpenMesh: quadric error first; no removed vertex
// farther than a tolerance from the triangles that replace its own; no normal turned by more than
// 30 degrees; no needles). Then the distance of the surfaces is bounded both ways:
// triangles are divided until all corners of a part lie within the bound of one and the same
// triangle, which is convex, so that all points between them do, too. Where it exceeds
// `max_error_m`, the vertices there are locked and all is done again, later with a smaller
// tolerance, too; if no attempt succeeds the mesh stays as it was.
// Vertices and triangles that stay keep their values and their order. The mesh must be an oriented
// manifold.
MeshDecimation decimate_mesh(TriangleMesh& mesh, double max_error_m,
                             Progress& progress = no_progress());

}  // namespace libmap
