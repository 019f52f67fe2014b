// Noise taken off a surface without shrinking it.
#pragma once

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Taubin 1995, "A signal processing approach to fair surface design": each iteration moves every
// vertex by 0.5 of the way to the mean of its neighbors, weighted by the inverse of the edge's
// length (Fujiwara), then by -0.505 of it: waves longer than the edges by far pass unchanged. The
// vertices of boundaries and non-manifold edges stay. Positions alone change. The same for any
// number of threads.
void smooth_mesh(TriangleMesh& mesh, int iterations);

}  // namespace libmap
