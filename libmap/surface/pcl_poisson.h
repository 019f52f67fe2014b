// PCL's Poisson reconstruction, made to give the same bytes in every run. Inner part of
// surface_reconstruction.
#pragma once

#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/surface/surface_sample.h"

namespace libmap {

struct PoissonProblem {
  int depth = 0;        // of the octree
  double cube_m = 0.0;  // its side, larger than the samples' box
  double screening = 4.0;
  double samples_per_cell = 1.0;
};

// The whole surface, positions alone. Throws Error of ErrorKind::failed if PCL gives up.
TriangleMesh solve_poisson(const std::vector<SurfaceSample>& samples,
                           const PoissonProblem& problem);

}  // namespace libmap
