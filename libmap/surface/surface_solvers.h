// Surfaces of oriented samples, without trimming. Private to surface_reconstruction.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct SurfaceSample {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m, about the samples' middle
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // unit, outwards
  float weight = 1.0F;                                 // > 0
  float spacing_m = 0.0F;                              // local distance between samples
};

// Callers bound spacing_m by so many cells, since work grows with its cube.
inline constexpr double max_spacing_cells = 4.0;

// Algebraic point set surface (Guennebaud and Gross 2007): at x, the algebraic sphere that fits
// positions and normals of the samples around best, with weights weight_i (c / r_i)^2 (1 - |x -
// p_i|^2 / r_i^2)^3 within r_i = support_cells * max(c, spacing_i), c = cell_m; the function is the
// sphere's value at x. Its zero set, oriented along the normals, by marching cubes (Lorensen and
// Cline 1987) with edges c at whole multiples of c. Open where the samples end: a cube is left out
// if, aside of the mean normal, one of its corners is farther from the samples' weighted mean than
// 0.4 r (Adamson and Alexa 2004). The same bytes for any number of threads; a part of the surface
// depends only on the samples whose support reaches it. Positions alone.
TriangleMesh implicit_surface(const std::vector<SurfaceSample>& samples, double cell_m,
                              double support_cells);

// PCL's Poisson reconstruction, with the same bytes in every run.
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
