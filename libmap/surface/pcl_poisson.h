// PCL's Poisson reconstruction, made to give the same bytes in every run. Inner part of
// poisson_reconstruction.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct PoissonSample {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m, about the samples' middle
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // unit, outwards
  float weight = 1.0F;                                 // > 0
};

struct PoissonProblem {
  int depth = 0;        // of the octree
  double cube_m = 0.0;  // its side, larger than the samples' box
  double screening = 4.0;
  double samples_per_cell = 1.0;
};

// The whole surface, positions alone. Throws Error of ErrorKind::failed if PCL gives up.
TriangleMesh solve_poisson(const std::vector<PoissonSample>& samples,
                           const PoissonProblem& problem);

}  // namespace libmap
