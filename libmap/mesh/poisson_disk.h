// Samples a surface evenly by Poisson disks: random samples with a minimum distance, without gaps.
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
  // > 0: minimum distance between samples. Every disc of this radius on the surface contains a
  // sample; with the default, so does every 1 cm voxel (usual in maps) that level ground crosses.
  double radius_m = 0.005;
  std::uint64_t count = 0;  // > 0: number of samples (within 1 %), instead of radius_m; 0: not used
  std::uint64_t seed = 1;   // random seed of the samples
};
void bind(ParameterTable& table, PoissonDiskOptions& options);

struct PoissonDiskResult {
  // Samples with unit normals, colors and fields of the surface. Within 256 m of the origin,
  // positions are rounded to single precision, so that files preserve the minimum distance.
  PointCloud cloud;
  double radius_m = 0.0;  // required minimum distance between samples
  double area_m2 = 0.0;   // area of the surface
  // Minimum distance of two samples, including samples of other tiles; 0 for a single sample.
  double smallest_distance_m = 0.0;
  // R / (2 sqrt(A / (2 sqrt(3) N))), R = smallest_distance_m, A = area_m2, N samples: R relative to
  // the densest packing of N discs in the plane (Lagae and Dutre 2008). At most 1 in the plane.
  double relative_radius = 0.0;
  std::size_t tried_radii = 0;  // number of radii that were tried
  bool count_reached = true;    // false if `count` was missed by more than 1 %
  StageTimings timings_s;
};
void describe(ResultTable& table, const PoissonDiskResult& result);

// Samples a mesh. Distances are Euclidean, so samples on one side of a thin plate exclude samples
// on the other side. Every point of the surface is within 1.001 radii (plus rounding) of a sample.
// Random points (darts) are tried evenly over the surface, then in the gaps between the discs,
// which are divided until a disc covers each part (after Ebeida et al. 2012). A `count` below 100
// is reached exactly if one of 100 tried radii yields it. Throws Error if an option is out of
// range, the mesh has no area, a vertex is not finite, or the radius is too small: the limit is 100
// samples per triangle, but at least 2.5 million and at most 10^8 samples.
PoissonDiskResult sample_poisson_disk(const TriangleMesh& mesh, const PoissonDiskOptions& options,
                                      Progress& progress = no_progress());

// Samples a surface that is divided into tiles, tile by tile, with a given radius. The minimum
// distance also applies between tiles, and seams have no gaps. Memory depends on the tile size.
class TileSampler {
 public:
  // `boxes`: bounding box of each tile. Throws Error if `count` > 0 or an option is out of range.
  TileSampler(std::vector<Bounds3d> boxes, const PoissonDiskOptions& options);
  // Samples tile `number`, the index of its box; each tile may be sampled once. Returns no samples
  // if the tile has no area. Throws as sample_poisson_disk.
  PoissonDiskResult sample(const TriangleMesh& mesh, std::size_t number,
                           Progress& progress = no_progress());

 private:
  std::vector<Bounds3d> boxes_;
  PoissonDiskOptions options_;
  std::vector<std::vector<Eigen::Vector3d>> near_;  // samples of other tiles, by tile
};

}  // namespace libmap
