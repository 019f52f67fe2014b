// A surface from a cloud of oriented points, in cells of the wanted size: by an algebraic point
// set surface (surface_solvers.h), or by PCL's screened Poisson reconstruction (Kazhdan and Hoppe
// 2013).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// implicit: algebraic point set surface; it ends with the points. poisson: one thread, ten times as
// slow; it ends about a cell farther out.
enum class SurfaceMethod { implicit, poisson };

struct SurfaceReconstructionOptions {
  SurfaceMethod method = SurfaceMethod::implicit;
  double support_cells = 2.5;  // >= 1.5: of a sample, with `implicit`; see surface_solvers.h
  // >= 0: of the grid, or of the octree's finest cells; edges of the mesh are about as long. 0: the
  // median distance of points to their nearest neighbors (median_spacing).
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

// What all parts of a surface have in common that are made of parts of a cloud. Clouds may be added
// part by part, in any order.
class SurfaceSurvey {
 public:
  // Throws Error if the cloud has points but no normals.
  void add(const PointCloud& cloud, bool weigh_by_error);

  std::size_t points() const { return points_; }           // with a normal
  std::size_t dropped_points() const { return dropped_; }  // without
  const Bounds3d& bounds() const { return bounds_; }       // of those with a normal
  // By whole cells from there the grid counts.
  Eigen::Vector3d origin() const { return (bounds_.min + bounds_.max) / 2; }
  // To 1.6 %; 0 if no point has an expected error.
  double median_error_m() const;

 private:
  std::size_t points_ = 0;
  std::size_t dropped_ = 0;
  Bounds3d bounds_;
  std::map<std::uint64_t, std::size_t> errors_;  // by their first bits
};

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
void describe(ResultTable& table, const SurfaceReconstructionResult& result);

// Estimated before the work, from the number and the spacing of the points.
struct SurfaceWork {
  double triangles = 0.0;
  double bytes = 0.0;    // of memory
  double seconds = 0.0;  // on one thread
};
using AnnounceWork = std::function<void(const SurfaceWork& work)>;

// Oriented; open where points end. What is not manifold is for clean_mesh, and with poisson the
// holes of single faces that PCL leaves out. PCL runs on one thread, since its result depends on
// their number, and what it prints is kept from standard output and error, whoever writes there
// meanwhile. The same bytes for any number of threads and any order of the points, but where points
// of equal position and normal differ; a shift of the cloud shifts the mesh, but for rounding.
// Throws Error: no normals, no point with a normal, normals whose neighbors face opposite sides,
// fewer than 3 places or places on a line, options out of their ranges, an octree deeper than
// max_octree_depth.
SurfaceReconstructionResult reconstruct_surface(const PointCloud& cloud,
                                                const SurfaceReconstructionOptions& options = {},
                                                Progress& progress = no_progress(),
                                                const AnnounceWork& announce = {});

// The same surface, but for rounding of the vertices' order, of a part of a cloud that `survey` has
// seen whole: exactly so farther than surface_margin_m() inside of where points are missing. For
// implicit surfaces with a cell size that is given; of too few points, nothing.
SurfaceReconstructionResult reconstruct_part(const PointCloud& part, const SurfaceSurvey& survey,
                                             const SurfaceReconstructionOptions& options,
                                             Progress& progress = no_progress());
// Throws Error naming the option that surfaces cannot be made in parts with.
double surface_margin_m(const SurfaceReconstructionOptions& options);

}  // namespace libmap
