// A surface from a cloud of oriented points: screened Poisson reconstruction (Kazhdan and Hoppe
// 2013) by PCL, in an octree whose finest cells have the wanted size.
#pragma once

#include <cstddef>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct PoissonReconstructionOptions {
  // >= 0: of the octree's finest cells; edges of the mesh are about as long. 0: the median distance
  // of points to their nearest neighbors.
  double cell_size_m = 0.0;
  double screening = 4.0;  // >= 0: how much the surface is held to the points against being smooth
  // Points count by their field `expected_error` (m), where they have it: inverse squares, and none
  // more than one of the median error.
  bool weigh_by_error = true;
  // > 0: points (or their weights) in a cell; with fewer the cells are larger there.
  double samples_per_cell = 2.15;
  // > 0: no surface farther than this from all points, in cells or, where that is more, in the
  // local distance between points.
  double trim_distance_cells = 1.5;
};
void bind(ParameterTable& table, PoissonReconstructionOptions& options);

// The octree goes no deeper: 2^12 cells along the longest side, a tenth of them margin. PCL's
// tables grow with the square of that number.
inline constexpr int max_octree_depth = 12;

struct PoissonReconstructionResult {
  // Unit vertex normals. Colors and fields carried over from the points around each vertex.
  TriangleMesh mesh;
  double cell_size_m = 0.0;
  double spacing_m = 0.0;          // median distance of nearest neighbors
  std::size_t dropped_points = 0;  // whose normal is zero or not finite
  std::size_t samples = 0;         // the points of one cell and side are one
  int octree_depth = 0;
  std::size_t trimmed_triangles = 0;
  StageTimings timings_s;
};

// Oriented; open where points end. PCL leaves out single faces: the holes, and what else is not
// manifold, is for clean_mesh. PCL runs on one thread, since its result depends on their number,
// and what it prints is kept from standard output and error, whoever writes there meanwhile. The
// same bytes for any number of threads and any order of the points, but where points of equal
// position and normal differ; a shift of the cloud shifts the mesh, but for rounding. Throws Error:
// no normals, no point with a normal, fewer than 3 places or places on a line, options out of their
// ranges, an octree deeper than max_octree_depth.
PoissonReconstructionResult reconstruct_surface(const PointCloud& cloud,
                                                const PoissonReconstructionOptions& options = {},
                                                Progress& progress = no_progress());

}  // namespace libmap
