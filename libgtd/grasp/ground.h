// The ground that grippers are closed on: a triangle mesh, and the part of it around one location.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libgtd {

// The triangles near one location in its frame: the location in the origin, z against the direction
// of the approach, x as near to the mesh's x axis as this allows (else its y axis). Meters.
struct GroundPatch {
  Eigen::Isometry3d mesh_from_patch = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> vertices;
  std::vector<libmap::Triangle> triangles;
  std::vector<Eigen::Vector3d> area_normals;  // their lengths are twice the areas
  std::vector<Eigen::Vector3d> centers;       // of spheres around the triangles
  std::vector<double> radii;                  // of these
  // As GroundErrors; empty without.
  std::vector<double> vertex_errors_m;
  std::vector<Eigen::Vector3d> vertex_normals;
  std::vector<std::uint8_t> is_unsure;

  // Normals, centers and radii by the vertices.
  void measure_triangles();

  // Mean of the triangles within `radius_m` of a point, weighted by their areas and, falling to 0
  // at the radius, by their nearness; unit length. Nothing if there is none.
  std::optional<Eigen::Vector3d> normal_at(const Eigen::Vector3d& point, double radius_m) const;
};

// How well the ground of a mesh is known. Empty: exactly.
struct GroundErrors {
  std::vector<double> vertex_errors_m;  // standard deviations along the vertices' normals
  std::vector<std::uint8_t> is_unsure;  // of triangles: 1 where the scan says too little
};

// The frame of a patch.
Eigen::Isometry3d patch_frame(const Eigen::Vector3d& location, const Eigen::Vector3d& away);

class Ground {
 public:
  // Throws Error if the mesh has no triangle, an index out of range or a vertex that is not finite,
  // or the errors are not of the mesh. The mesh must stay while this lives.
  explicit Ground(const libmap::TriangleMesh& mesh, GroundErrors errors = {});
  ~Ground();
  Ground(Ground&&) noexcept;
  Ground& operator=(Ground&&) noexcept;

  // All triangles that come into the cylinder about the location along `away` (a direction out of
  // the ground), from `above_m` down to the lowest part of the mesh, and some outside of it. Its
  // radius is larger by `widening` times `above_m` or, if that is more, the depth below the
  // location. May be called from several threads at once.
  GroundPatch patch(const Eigen::Vector3d& location, const Eigen::Vector3d& away, double radius_m,
                    double above_m, double widening = 0.0) const;

  // Distance from a point to the nearest triangle within `radius_m`, m; nothing if there is none.
  std::optional<double> distance(const Eigen::Vector3d& point, double radius_m) const;

  // Of the vertices; 0 without errors.
  double largest_error_m() const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

}  // namespace libgtd
