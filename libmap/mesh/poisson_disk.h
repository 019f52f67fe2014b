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
  // Default: half of the usual voxel size of a map, 1 cm. Every disc of this radius on the surface
  // contains a sample, and so does every such voxel that level ground intersects.
  double radius_m = 0.005;  // > 0: minimum distance between samples
  std::uint64_t count = 0;  // > 0: number of samples (within 1 %); the radius is computed
  std::uint64_t seed = 1;   // random seed of the samples
};
void bind(ParameterTable& table, PoissonDiskOptions& options);

struct PoissonDiskResult {
  // Samples with unit normals, colors and fields of the surface. Within 256 m of the origin,
  // positions are rounded to single precision, so that files preserve the minimum distance.
  PointCloud cloud;
  double radius_m = 0.0;  // required minimum distance between samples
  double area_m2 = 0.0;   // area of the surface
  // Between two samples, including those of other tiles; >= radius_m; 0 for a single sample.
  double smallest_distance_m = 0.0;
  // smallest_distance_m relative to the densest packing of as many discs in the plane: R / (2
  // sqrt(A / (2 sqrt(3) N))) (Lagae and Dutre 2008). At most 1 in the plane.
  double relative_radius = 0.0;
  std::size_t tried_radii = 0;  // number of radii that were tried
  bool count_reached = true;    // false if `count` was missed by more than 1 %
  StageTimings timings_s;
};
void describe(ResultTable& table, const PoissonDiskResult& result);

// Samples a mesh. Distances are Euclidean, so both sheets of a thin plate share samples. Every
// point of the surface is within 1.001 radii (plus rounding) of a sample. Darts are thrown evenly
// over the surface, then into the gaps, which are divided until each is covered by a disc (after
// Ebeida et al. 2012). The result does not depend on the number of threads. A `count` below 100 is
// reached exactly if one of 100 tried radii yields it. Throws Error if an option is out of range,
// the mesh has no area, a vertex is not finite, or the radius yields more than 100 samples per
// triangle (limit at least 2.5 million and at most 10^8 samples) or is tiny compared with the mesh.
PoissonDiskResult sample_poisson_disk(const TriangleMesh& mesh, const PoissonDiskOptions& options,
                                      Progress& progress = no_progress());

// Samples a surface that is divided into tiles, tile by tile, with a given radius. The minimum
// distance also applies between tiles, and seams have no gaps. Memory depends on the tile size.
class TileSampler {
 public:
  // Takes all tiles' bounding boxes. Throws Error if `count` is set or an option is out of range.
  TileSampler(std::vector<Bounds3d> boxes, const PoissonDiskOptions& options);
  // Samples tile `number`; each tile may be sampled once. Returns no samples if the tile has no
  // area. Throws as sample_poisson_disk.
  PoissonDiskResult sample(const TriangleMesh& mesh, std::size_t number,
                           Progress& progress = no_progress());

 private:
  std::vector<Bounds3d> boxes_;
  PoissonDiskOptions options_;
  std::vector<std::vector<Eigen::Vector3d>> near_;  // samples of other tiles, by tile
};

}  // namespace libmap
