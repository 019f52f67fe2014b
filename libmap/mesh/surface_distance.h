// How far points lie from a mesh's surface, and how much of the surface they cover.
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
  std::uint32_t triangle = 0;
  double distance_m = 0.0;  // from the point that was asked for
};

class SurfaceDistance {
 public:
  // Throws Error if the mesh has no triangle, an index out of range or a vertex that is not finite.
  // The mesh may go away afterwards.
  explicit SurfaceDistance(const TriangleMesh& mesh) : mesh_(mesh, false) {}

  // The surface's point nearest to a finite point (Embree finds the candidates; distances are in
  // double precision). May be called from several threads at once.
  SurfacePoint nearest(const Eigen::Vector3d& point) const;

 private:
  EmbreeMesh mesh_;
};

// The nearest point of a triangle (Ericson 2005, section 5.1.5).
Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// Distance of each point from the surface, m.
std::vector<double> distances_to_surface(const std::vector<Eigen::Vector3d>& points,
                                         const TriangleMesh& mesh);

struct DistanceStatistics {
  std::size_t count = 0;  // all else is 0 if this is
  double rmse_m = 0.0;
  double mean_m = 0.0;
  double median_m = 0.0;
  double p95_m = 0.0;  // 95 of 100 are as near
  double max_m = 0.0;
};
void describe(ResultTable& table, const DistanceStatistics& statistics);  // but for `count`
// Mean, root mean square, median, 95th percentile and maximum; zeros of no distances.
DistanceStatistics distance_statistics(std::vector<double> distances_m);

// Points of the surface, `per_m2` on each square meter on the mean, drawn with `seed`: the same for
// any number of threads. Throws Error if the mesh has no area, or if more were asked for than 100 a
// triangle or 2.5 million, whichever is more, or than 10^8.
std::vector<TrianglePoint> sample_triangles(const TriangleMesh& mesh, double per_m2,
                                            std::uint64_t seed);
std::vector<SurfacePoint> sample_surface(const TriangleMesh& mesh, double per_m2,
                                         std::uint64_t seed);

// Whether each sample has one of `points` within `radius_m`.
std::vector<bool> covered(const std::vector<Eigen::Vector3d>& samples,
                          const std::vector<Eigen::Vector3d>& points, double radius_m);
double share_of(const std::vector<bool>& flags);  // 0 if there are none

}  // namespace libmap
