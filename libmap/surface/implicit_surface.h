// The surface of an implicit function that depends on near samples only. Inner part of
// surface_reconstruction.
#pragma once

#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/surface/surface_sample.h"

namespace libmap {

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

}  // namespace libmap
