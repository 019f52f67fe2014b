// The surface that points are compared with or aligned to: a mesh, or what a cloud stands for.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct NearestPlace {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // on the surface
  // Unit; zero where the surface has no sides. On an edge or a corner of a mesh it is the
  // angle-weighted pseudo-normal, which tells inside from outside (Baerentzen and Aanaes 2005).
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double distance_m = 0.0;
  // The point lies beside the surface rather than over it: the nearest place is on its border.
  bool on_border = false;

  // Distance, negative on the side from which the normal points away; >= 0 without sides.
  double signed_distance_m(const Eigen::Vector3d& point) const {
    return (point - position).dot(normal) < 0.0 ? -distance_m : distance_m;
  }
};

class ReferenceSurface {
 public:
  // The surface of a mesh; it may go away afterwards. Throws Error if it has no triangle, an index
  // out of range or a vertex that is not finite.
  explicit ReferenceSurface(const TriangleMesh& mesh);

  // Of a cloud with normals: discs about the points, across their normals, of twice the median
  // distance between neighbors as radius; a point's distance is that to the disc of the nearest
  // point. So the gaps between the points of a dense cloud count for nothing, holes for what they
  // are. Without normals, or where a normal is zero: the points themselves. Throws Error if there
  // is no point or one is not finite.
  explicit ReferenceSurface(const PointCloud& cloud);

  ~ReferenceSurface();
  ReferenceSurface(ReferenceSurface&&) noexcept;
  ReferenceSurface& operator=(ReferenceSurface&&) noexcept;

  // Whether it has sides, everywhere.
  bool is_oriented() const;
  // Of the points or vertices it is made of.
  const Bounds3d& bounds() const;

  // The place nearest to a finite point. May be called from several threads at once.
  NearestPlace nearest(const Eigen::Vector3d& point) const;

 private:
  struct Shape;
  struct MeshShape;
  struct CloudShape;
  std::unique_ptr<Shape> shape_;
};

struct PointDistances {
  std::vector<double> distance_m;
  std::vector<double> signed_distance_m;  // equal to distance_m where the surface has no sides
};
// The distance of each point to the surface; bytes do not depend on the number of threads.
PointDistances distances_to(const ReferenceSurface& surface,
                            const std::vector<Eigen::Vector3d>& points);

}  // namespace libmap
