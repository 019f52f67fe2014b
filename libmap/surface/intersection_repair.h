// Places where a surface runs through itself, taken out and closed again.
#pragma once

#include <cstddef>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct IntersectionRepair {
  std::size_t faulty_triangles = 0;     // removed, without those around them
  std::size_t closing_triangles = 0;    // that now close the places
  std::size_t open_places = 0;          // boundaries that are left of them
  std::size_t remaining_triangles = 0;  // that still meet others or are degenerate
};

// In rounds: triangles that meet others (self_intersections) or are degenerate are removed with a
// ring of triangles around them, scraps that this cuts off as well, and the holes that it makes,
// unless they reach a boundary that was there before, are closed (hole_filling; marked `filled`).
// Each round takes one more ring. What still meets others after four rounds is removed alone and
// stays open; vertices that this parts lie `min_gap_m` apart (mesh_manifold). The mesh must be an
// oriented manifold, and is one afterwards.
IntersectionRepair repair_intersections(TriangleMesh& mesh, double min_gap_m = 0.0);

}  // namespace libmap
