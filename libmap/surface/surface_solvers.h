// Computes surfaces from samples with normals: implicit (algebraic point set surface) and Poisson,
// without trimming. Private to surface_reconstruction.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct SurfaceSample {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m, relative to a common origin
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // unit, outwards
  float weight = 1.0F;                                 // > 0: weight in the fit
  float spacing_m = 0.0F;                              // local distance between samples
};

// Maximum of spacing_m in cells, which callers must apply; work is proportional to spacing_m^3.
inline constexpr double max_spacing_cells = 4.0;

// Algebraic point set surface (Guennebaud and Gross 2007). At x, an algebraic sphere is fitted to
// positions p_i and normals of the samples within r_i = support_cells * max(c, spacing_i) of x, for
// c = cell_m. The weights are weight_i (c / r_i)^2 (1 - |x - p_i|^2 / r_i^2)^3. The function is the
// sphere's value at x. The zero set is computed by marching cubes (Lorensen and Cline 1987) on a
// grid of multiples of c and oriented along the normals. So that the surface is open at the border
// of the samples, a cube is dropped if a corner is farther than 0.4 r from the samples' weighted
// mean, perpendicular to the mean normal (Adamson and Alexa 2004; r: weighted mean of r_i). A part
// of the surface depends only on the samples whose r_i reaches the part. The result does not depend
// on the number of threads and has positions only.
TriangleMesh implicit_surface(const std::vector<SurfaceSample>& samples, double cell_m,
                              double support_cells);

// Parameters of PCL's Poisson reconstruction.
struct PoissonProblem {
  int depth = 0;                  // of the octree: 2^depth cells along a side
  double cube_m = 0.0;            // side of the octree, larger than the samples' bounding box
  double screening = 4.0;         // as in SurfaceReconstructionOptions
  double samples_per_cell = 1.0;  // as in SurfaceReconstructionOptions
};

// Deterministic Poisson reconstruction, positions only. Throws Error (failed) if PCL fails.
TriangleMesh solve_poisson(const std::vector<SurfaceSample>& samples,
                           const PoissonProblem& problem);

}  // namespace libmap
