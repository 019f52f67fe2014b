// Distances of points from a mesh, random samples of a mesh, and coverage of samples by points.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/result_table.h"
#include "libmap/mesh/embree_mesh.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

struct SurfacePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::uint32_t triangle = 0;  // index of the triangle with `position`
  double distance_m = 0.0;     // from the query point
};

class SurfaceDistance {
 public:
  // Copies the mesh. Throws Error if it has no triangle, an invalid index or a non-finite vertex.
  explicit SurfaceDistance(const TriangleMesh& mesh) : mesh_(mesh, false) {}

  // Returns the nearest point of the surface to a finite point. Embree finds the candidates;
  // distances are in double precision. Thread-safe.
  SurfacePoint nearest(const Eigen::Vector3d& point) const;

 private:
  EmbreeMesh mesh_;
};

// Nearest point of a triangle (Ericson 2005, section 5.1.5).
Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// Returns the distance of each point from the surface, m. Throws as SurfaceDistance does.
std::vector<double> distances_to_surface(const std::vector<Eigen::Vector3d>& points,
                                         const TriangleMesh& mesh);

struct DistanceStatistics {
  std::size_t count = 0;  // 0: all statistics are 0
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double median_m = 0.0;
  double p95_m = 0.0;  // 95th percentile
  double max_m = 0.0;
};
void describe(ResultTable& table, const DistanceStatistics& statistics);  // without `count`
// Returns the statistics of distances, which can be in any order.
DistanceStatistics distance_statistics(std::vector<double> distances_m);

// Returns random points of the surface, evenly distributed with `per_m2` points per square meter.
// Throws Error if the mesh has no area or there are too many points. The limit is 100 points per
// triangle, but at least 2.5 million and at most 10^8 points.
std::vector<TrianglePoint> sample_triangles(const TriangleMesh& mesh, double per_m2,
                                            std::uint64_t seed);
// Returns the points of sample_triangles with positions; distance_m is 0.
std::vector<SurfacePoint> sample_surface(const TriangleMesh& mesh, double per_m2,
                                         std::uint64_t seed);

// Returns for each sample true if one of `points` is within `radius_m`.
std::vector<bool> covered(const std::vector<Eigen::Vector3d>& samples,
                          const std::vector<Eigen::Vector3d>& points, double radius_m);
double fraction_of(const std::vector<bool>& flags);  // share of true flags; 0 if there are no flags

}  // namespace libmap
