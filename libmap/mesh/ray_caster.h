// Rays against a triangle mesh (Embree). Triangles are found in single precision about the mesh's
// center, watertight along shared edges; where a ray meets them is then computed in double
// precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>

#include "libmap/mesh/embree_mesh.h"

namespace libmap {

struct RayHit {
  static constexpr std::uint32_t no_triangle = 0xffffffff;

  double distance = 0.0;  // in lengths of the ray's direction
  std::uint32_t triangle = 0;
  double u = 0.0;  // barycentric: (1 - u - v) * a + u * b + v * c
  double v = 0.0;
};

class RayCaster {
 public:
  // Throws Error if the mesh has no triangle, an index out of range or a vertex that is not finite.
  // The mesh may go away afterwards.
  explicit RayCaster(const TriangleMesh& mesh);

  // The nearest triangle along origin + distance * direction, distance between `near` and `far`
  // (0 <= near <= far), from either side. Nothing where the direction is zero or not finite. May be
  // called from several threads at once.
  std::optional<RayHit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                             double near = 0.0, double far = 1e30) const;

  // The same for many rays from one place, quickest where neighbors in `directions` point nearly
  // the same way; `hits` is as long. RayHit::no_triangle marks a ray that meets nothing.
  void cast_bundle(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                   std::span<RayHit> hits, double near = 0.0, double far = 1e30) const;

 private:
  EmbreeMesh mesh_;
  Eigen::AlignedBox3d box_;  // about the mesh's center, a little larger than the mesh
};

}  // namespace libmap
