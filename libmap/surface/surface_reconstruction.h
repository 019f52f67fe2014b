// A surface from a cloud of oriented points, in cells of the wanted size: by an algebraic point
// set surface (implicit_surface.h), or by PCL's screened Poisson reconstruction (Kazhdan and Hoppe
// 2013).
#pragma once

#include <cstddef>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// implicit: algebraic point set surface; it ends with the points. poisson: one thread, ten times as
// slow; it ends about a cell farther out.
enum class SurfaceMethod { implicit, poisson };

struct SurfaceReconstructionOptions {
  SurfaceMethod method = SurfaceMethod::implicit;
  double support_cells = 2.5;  // >= 1.5: of a sample, with `implicit`; see implicit_surface.h
  // >= 0: of the grid, or of the octree's finest cells; edges of the mesh are about as long. 0: the
  // median distance of points to their nearest neighbors.
  double cell_size_m = 0.0;
  // poisson, >= 0: how much the surface is held to the points against being smooth
  double screening = 4.0;
  // Points count by their field `expected_error` (m), where they have it: inverse squares, and none
  // more than one of the median error.
  bool weigh_by_error = true;
  // poisson, > 0: points (or their weights) in a cell; with fewer the cells are larger there.
  double samples_per_cell = 2.15;
  // > 0: no surface farther than this from all points, in cells or, where that is more, in the
  // local distance between points.
  double trim_distance_cells = 1.5;
};
void bind(ParameterTable& table, SurfaceReconstructionOptions& options);

// poisson: the octree goes no deeper: 2^12 cells along the longest side, a tenth of them margin.
// PCL's tables grow with the square of that number.
inline constexpr int max_octree_depth = 12;

struct SurfaceReconstructionResult {
  // Unit vertex normals. Colors and fields carried over from the points around each vertex.
  TriangleMesh mesh;
  double cell_size_m = 0.0;
  double spacing_m = 0.0;          // median distance of nearest neighbors
  std::size_t dropped_points = 0;  // whose normal is zero or not finite
  std::size_t samples = 0;         // the points of one cell and side are one
  int octree_depth = 0;            // poisson
  std::size_t trimmed_triangles = 0;
  StageTimings timings_s;
};

// Oriented; open where points end. What is not manifold is for clean_mesh, and with poisson the
// holes of single faces that PCL leaves out. PCL runs on one thread, since its result depends on
// their number, and what it prints is kept from standard output and error, whoever writes there
// meanwhile. The same bytes for any number of threads and any order of the points, but where points
// of equal position and normal differ; a shift of the cloud shifts the mesh, but for rounding.
// Throws Error: no normals, no point with a normal, fewer than 3 places or places on a line,
// options out of their ranges, an octree deeper than max_octree_depth.
SurfaceReconstructionResult reconstruct_surface(const PointCloud& cloud,
                                                const SurfaceReconstructionOptions& options = {},
                                                Progress& progress = no_progress());

}  // namespace libmap
