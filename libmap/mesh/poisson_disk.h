// Poisson-disk samples of a surface: no two nearer than a radius, no room for another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct PoissonDiskOptions {
  // Half of the scenarios' voxel of 1 cm: every disc of this radius on the surface holds a sample,
  // and so does every voxel that level ground passes through.
  double radius_m = 0.005;  // > 0: least distance of two samples
  std::uint64_t count = 0;  // > 0: so many samples to 1 %; the radius is searched for
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, PoissonDiskOptions& options);

struct PoissonDiskResult {
  // Unit normals, colors and fields of the surface. Positions are those of single precision where
  // the mesh lies within 256 m of its origin: files keep them, and so their distances, exactly.
  PointCloud cloud;
  double radius_m = 0.0;
  double area_m2 = 0.0;
  double smallest_distance_m = 0.0;  // of two samples, >= radius_m; 0 if there is but one
  // smallest_distance_m over that of the densest packing of as many discs in the plane: R / (2
  // sqrt(A / (2 sqrt(3) N))) (Lagae and Dutre 2008). At most 1 in the plane.
  double relative_radius = 0.0;
  std::size_t tries = 0;      // radii that were tried
  bool count_reached = true;  // within 1 %, if a number was asked for
  StageTimings timings_s;
};
void describe(ResultTable& table, const PoissonDiskResult& result);

// Distances are Euclidean: two sheets of a thin plate share their samples. Every point of the
// surface lies within 1.001 radii of a sample, and what single precision moves that. Darts are
// thrown evenly over the whole surface, then over what they left uncovered, which is cut into
// smaller and smaller triangles until a disc covers each (after Ebeida et al. 2012). The same bytes
// for any number of threads; `count` of less than 100 is met exactly, where some radius yields it.
// Throws Error: options out of their ranges, a mesh without area or with a vertex that is not
// finite, a count of more than 10^8 samples, or a radius that asks for more than 100 a triangle
// or 2.5 million, whichever is more, or than 10^8.
PoissonDiskResult sample_poisson_disk(const TriangleMesh& mesh, const PoissonDiskOptions& options,
                                      Progress& progress = no_progress());

// The same surface in pieces, one after the other, by radius alone: no two samples of any pieces
// are nearer than the radius, and seams have no gap. Memory depends on the size of a piece, and on
// the samples near others.
class PieceSampler {
 public:
  // `boxes` of all pieces. Throws Error if a number of samples is asked for.
  PieceSampler(std::vector<Bounds3d> boxes, const PoissonDiskOptions& options);
  // Of piece `number`, each once; a mesh without area has none.
  PoissonDiskResult sample(const TriangleMesh& mesh, std::size_t number,
                           Progress& progress = no_progress());

 private:
  std::vector<Bounds3d> boxes_;
  PoissonDiskOptions options_;
  std::vector<std::vector<Eigen::Vector3d>> near_;  // samples of other pieces, by piece
};

}  // namespace libmap
