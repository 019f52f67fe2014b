// A triangle mesh in Embree, about its center. Private to libmap/mesh: rays and distances stand
// on it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "libmap/core/triangle_mesh.h"

struct RTCDeviceTy;  // embree3/rtcore.h
struct RTCSceneTy;

namespace libmap {

// Positions are relative to `center`, where single precision is finest.
class EmbreeMesh {
 public:
  // Throws Error if the mesh has no triangle, an index out of range or a vertex that is not finite.
  // `robust`: rays do not slip through shared edges.
  EmbreeMesh(const TriangleMesh& mesh, bool robust);
  EmbreeMesh(EmbreeMesh&&) = default;
  EmbreeMesh& operator=(EmbreeMesh&&) = default;

  RTCSceneTy* scene() const { return scene_.get(); }  // coordinates less center()
  const Eigen::Vector3d& center() const { return center_; }
  Eigen::Vector3d size() const { return size_; }  // of the bounding box, m
  // A corner of a triangle about the center, in double precision.
  const Eigen::Vector3d& corner(std::uint32_t triangle, int k) const {
    return vertices_[triangles_[triangle][static_cast<std::size_t>(k)]];
  }

 private:
  std::shared_ptr<RTCDeviceTy> device_;
  std::shared_ptr<RTCSceneTy> scene_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d size_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Triangle> triangles_;  // the scene reads them too
};

}  // namespace libmap
