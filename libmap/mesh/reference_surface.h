// Reference surface (a mesh or a cloud) for measuring distances of points and for alignment.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Nearest point of a surface to a query point.
struct NearestSurfacePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // on the surface
  // Unit normal; zero if a cloud's point has no normal. On an edge or a corner of a mesh it is the
  // angle-weighted pseudo-normal, which separates inside and outside (Baerentzen and Aanaes 2005).
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double distance_m = 0.0;  // between `position` and the query point
  bool on_border = false;   // true if `position` is on the border of the mesh, or of a cloud's disc

  // Distance, m; negative on the side opposite to `normal`; >= 0 if `normal` is zero.
  double signed_distance_m(const Eigen::Vector3d& point) const {
    return (point - position).dot(normal) < 0.0 ? -distance_m : distance_m;
  }
};

class ReferenceSurface {
 public:
  // Copies the mesh. Throws Error if it has no triangle, an invalid index or a non-finite vertex.
  explicit ReferenceSurface(const TriangleMesh& mesh);

  // Represents a cloud with normals by one disc per point, with a radius of twice the median point
  // spacing. Distances are to the disc of the nearest point. Discs close the gaps between points,
  // but not holes. Points without normals have no disc. Throws Error if empty or not finite.
  explicit ReferenceSurface(const PointCloud& cloud);

  ~ReferenceSurface();
  ReferenceSurface(ReferenceSurface&&) noexcept;
  ReferenceSurface& operator=(ReferenceSurface&&) noexcept;

  // True for a mesh and for a cloud with normals at all points.
  bool is_oriented() const;
  // Bounding box of the points or vertices.
  const Bounds3d& bounds() const;

  // Returns the nearest point of the surface to a finite point. Thread-safe.
  NearestSurfacePoint nearest(const Eigen::Vector3d& point) const;

 private:
  struct Shape;
  struct MeshShape;
  struct CloudShape;
  std::unique_ptr<Shape> shape_;
};

struct PointDistances {
  std::vector<double> distance_m;         // one per point, >= 0
  std::vector<double> signed_distance_m;  // equal to distance_m if the surface is not oriented
};
// Returns the distances of points to the surface; equal for any number of threads.
PointDistances distances_to(const ReferenceSurface& surface,
                            const std::vector<Eigen::Vector3d>& points);

}  // namespace libmap
