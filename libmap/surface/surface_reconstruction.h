// Reconstructs a mesh from a cloud with normals, as an algebraic point set surface
// (surface_solvers.h) or by PCL's screened Poisson reconstruction (Kazhdan and Hoppe 2013).
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

// implicit: algebraic point set surface, which ends at the border of the points. poisson: screened
// Poisson; one thread, several times slower, extends about one cell beyond the border.
enum class SurfaceMethod { implicit, poisson };

struct SurfaceReconstructionOptions {
  SurfaceMethod method = SurfaceMethod::implicit;
  // 1.5 to 10, implicit: influence radius of a point, in units of max(cell size, point spacing).
  double support_cells = 2.5;
  // >= 0: size of the grid's or the octree's finest cells, and about the length of the mesh's
  // edges. 0: the median distance between nearest neighbors (median_spacing).
  double cell_size_m = 0.0;
  double screening = 4.0;  // >= 0, for poisson: weight of the points relative to smoothness
  // Weights points by the inverse square of the field `expected_error` (m), if that exists; points
  // with less than the median error have equal weights.
  bool weigh_by_error = true;
  // > 0, for poisson: minimum number (or weight) of points per cell; with fewer, cells are larger.
  double samples_per_cell = 2.15;
  // > 0: maximum distance of the surface from points, in units of max(cell size, point spacing).
  double trim_distance_cells = 1.5;
};
void bind(ParameterTable& table, SurfaceReconstructionOptions& options);

// Maximum depth of the octree of poisson: 2^12 cells along the longest side, a tenth of them for a
// margin. The memory of PCL's tables is proportional to the square of the number of cells.
inline constexpr int max_octree_depth = 12;

// Statistics of a whole cloud for reconstruct_part. Parts of the cloud may be added in any order.
class CloudStatistics {
 public:
  // Throws Error if the cloud has points but no normals.
  void add(const PointCloud& cloud, bool weigh_by_error);

  std::size_t points() const { return points_; }           // points with a normal
  std::size_t dropped_points() const { return dropped_; }  // points without a normal
  const Bounds3d& bounds() const { return bounds_; }       // bounds of the points with a normal
  // Origin of the grid.
  Eigen::Vector3d origin() const { return (bounds_.min + bounds_.max) / 2; }
  // Median of `expected_error`, accurate to 1.6 %; 0 if no point has an expected error.
  double median_error_m() const;

 private:
  std::size_t points_ = 0;
  std::size_t dropped_ = 0;
  Bounds3d bounds_;
  std::map<std::uint64_t, std::size_t> errors_;  // histogram
};

struct SurfaceReconstructionResult {
  // Has unit vertex normals, and colors and fields from the points around each vertex.
  TriangleMesh mesh;
  double cell_size_m = 0.0;           // the option cell_size_m, or spacing_m if that is 0
  double spacing_m = 0.0;             // median distance to the nearest neighbor
  std::size_t dropped_points = 0;     // points with a normal that is zero or not finite
  std::size_t samples = 0;            // samples: mean points, one per cell and side of the surface
  int octree_depth = 0;               // poisson; otherwise 0
  std::size_t trimmed_triangles = 0;  // removed: too far from points, or against their normals
  StageTimings timings_s;
};
void describe(ResultTable& table, const SurfaceReconstructionResult& result);

// Estimate of the work from the number and the spacing of the points.
struct SurfaceWork {
  double triangles = 0.0;  // number of triangles
  double bytes = 0.0;      // memory
  double seconds = 0.0;    // on one thread
};
using AnnounceWork = std::function<void(const SurfaceWork& work)>;

// Reconstructs an oriented surface that is open at the border of the points. The surface may have
// non-manifold parts, and with poisson holes of single faces, which clean_mesh repairs. PCL runs on
// one thread, because its result depends on the number of threads; meanwhile, standard output and
// error of the process are discarded. The result does not depend on the number of threads. It does
// not depend on the order of the points, except for different values at equal position and normal.
// A shift of the cloud shifts the mesh, except for rounding. `announce` is called with the
// estimated work before the work begins. Throws Error if an option is out of range, PCL fails, the
// cloud has no normals or inconsistent array sizes, or the positions are fewer than 3 or on a line;
// or if cells are larger than the cloud, or too small for the point spacing or the octree's depth.
SurfaceReconstructionResult reconstruct_surface(const PointCloud& cloud,
                                                const SurfaceReconstructionOptions& options = {},
                                                Progress& progress = no_progress(),
                                                const AnnounceWork& announce = {});

// Reconstructs the surface of a part of a cloud; `statistics` are the statistics of the whole
// cloud. Farther than surface_margin_m() from all points that `part` lacks, the surface equals the
// surface of the whole cloud, except for the order of vertices and triangles. Returns an empty mesh
// for too few points. Throws Error as reconstruct_surface and surface_margin_m do.
SurfaceReconstructionResult reconstruct_part(const PointCloud& part,
                                             const CloudStatistics& statistics,
                                             const SurfaceReconstructionOptions& options,
                                             Progress& progress = no_progress());
// Returns the distance up to which points influence the surface, m. Throws Error if the method is
// poisson or the cell size is 0.
double surface_margin_m(const SurfaceReconstructionOptions& options);

}  // namespace libmap
