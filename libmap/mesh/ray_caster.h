// Rays against a triangle mesh (Embree), in single precision about the mesh's centre.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct RayHit {
  double distance = 0.0;  // in lengths of the ray's direction
  std::uint32_t triangle = 0;
  double u = 0.0;  // barycentric: (1 - u - v) * a + u * b + v * c
  double v = 0.0;
};

class RayCaster {
 public:
  // Throws Error if the mesh has no triangle. The mesh may go away afterwards.
  explicit RayCaster(const TriangleMesh& mesh);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;
  RayCaster& operator=(RayCaster&&) noexcept;

  // The nearest triangle along origin + distance * direction, distance between `near` and `far`,
  // from either side. May be called from several threads at once.
  std::optional<RayHit> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                             double near = 0.0, double far = 1e30) const;
  bool is_blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                  double near = 0.0, double far = 1e30) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace libmap
