// Ray casting against a triangle mesh (Embree). Triangles are found in single precision relative to
// the mesh center, watertight at shared edges; intersections are then refined in double precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>

#include "libmap/mesh/embree_mesh.h"

namespace libmap {

struct RayHit {
  static constexpr std::uint32_t no_triangle = 0xffffffff;  // `triangle` without intersection

  double distance = 0.0;       // in units of the direction's length
  std::uint32_t triangle = 0;  // index of the triangle, with corners a, b, c
  double u = 0.0;              // position: (1 - u - v) * a + u * b + v * c
  double v = 0.0;
};

class RayCaster {
 public:
  // Copies the mesh. Throws Error if it has no triangle, an invalid index or a non-finite vertex.
  explicit RayCaster(const TriangleMesh& mesh);

  // Returns the nearest intersection, origin + distance * direction, with either side of a
  // triangle, where `near` <= distance <= `far`. Returns nullopt if there is no intersection, or if
  // the direction is zero or not finite. Thread-safe.
  std::optional<RayHit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                             double near = 0.0, double far = 1e30) const;

  // Casts one ray per direction, fastest if successive directions are similar. hits[n] becomes the
  // hit of directions[n]; triangle = no_triangle: no hit. Throws Error if the sizes differ.
  void cast_bundle(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                   std::span<RayHit> hits, double near = 0.0, double far = 1e30) const;

 private:
  EmbreeMesh mesh_;
  Eigen::AlignedBox3d box_;  // slightly larger than the mesh, relative to the mesh center
};

}  // namespace libmap
