// Triangle mesh in Embree's data structures, for ray casting and distances. Private to libmap/mesh.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "libmap/core/triangle_mesh.h"

struct RTCDeviceTy;  // embree3/rtcore.h
struct RTCSceneTy;

namespace libmap {

// Positions are relative to the center of the bounding box, where float32 is most accurate.
class EmbreeMesh {
 public:
  // Throws Error if the mesh has no triangle, an index out of range or a vertex that is not finite.
  // With `robust`, rays do not pass between two triangles at their shared edge.
  EmbreeMesh(const TriangleMesh& mesh, bool robust);
  EmbreeMesh(EmbreeMesh&&) = default;
  EmbreeMesh& operator=(EmbreeMesh&&) = default;

  RTCSceneTy* scene() const { return scene_.get(); }  // positions relative to center(), m
  const Eigen::Vector3d& center() const { return center_; }
  Eigen::Vector3d size() const { return size_; }  // size of the bounding box, m
  // Position of corner k (0 to 2) of a triangle relative to center(), m, in double precision.
  const Eigen::Vector3d& corner(std::uint32_t triangle, int k) const {
    return vertices_[triangles_[triangle][static_cast<std::size_t>(k)]];
  }

 private:
  std::shared_ptr<RTCDeviceTy> device_;
  std::shared_ptr<RTCSceneTy> scene_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d size_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Triangle> triangles_;  // shared with the scene
};

}  // namespace libmap
