// Ground of the virtual field test: a triangle mesh, and patches of the mesh around locations.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libgtd {

// Triangles near a location, in m in the frame of the patch: location at the origin, z opposite to
// the approach, x along the projection of the mesh's x axis (y axis if x is nearly parallel to z).
struct GroundPatch {
  Eigen::Isometry3d mesh_from_patch = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> vertices;
  std::vector<libmap::Triangle> triangles;
  std::vector<Eigen::Vector3d> area_normals;  // normals of the triangles; length: twice the area
  std::vector<Eigen::Vector3d> centers;       // centers of bounding spheres of the triangles
  std::vector<double> radii;                  // radii of these spheres
  // Errors as in GroundErrors, and unit vertex normals; all three are empty for exact ground.
  std::vector<double> vertex_errors_m;
  std::vector<Eigen::Vector3d> vertex_normals;
  std::vector<std::uint8_t> is_unscanned;

  // Computes normals, centers and radii from the vertices.
  void measure_triangles();

  // Returns the unit mean normal of the triangles within `radius_m` of a point, weighted by area
  // and by nearness (0 at the radius); nullopt if there are no triangles.
  std::optional<Eigen::Vector3d> normal_at(const Eigen::Vector3d& point, double radius_m) const;
};

// Errors of a mesh as a model of the real ground. Both lists are empty for exact ground.
struct GroundErrors {
  std::vector<double> vertex_errors_m;     // standard deviations along the vertex normals
  std::vector<std::uint8_t> is_unscanned;  // per triangle: 1 if insufficiently scanned
};

// Returns mesh_from_patch of a location; `away` is the direction opposite to the approach.
Eigen::Isometry3d patch_frame(const Eigen::Vector3d& location, const Eigen::Vector3d& away);

class Ground {
 public:
  // Throws Error if the mesh has no triangles, an index out of range or a vertex that is not
  // finite, or if the sizes of the errors do not match the mesh. The mesh must outlive this object.
  explicit Ground(const libmap::TriangleMesh& mesh, GroundErrors errors = {});
  ~Ground();
  Ground(Ground&&) noexcept;
  Ground& operator=(Ground&&) noexcept;

  // Returns all triangles that intersect a cylinder that widens downwards, and some others. The
  // axis passes through `location` along `away`, which points out of the ground (both in the mesh
  // frame). The solid extends from `above_m` above the location to the lowest point of the mesh.
  // Its radius at depth d below the location is radius_m + widening * max(above_m, d). Thread-safe.
  GroundPatch patch(const Eigen::Vector3d& location, const Eigen::Vector3d& away, double radius_m,
                    double above_m, double widening = 0.0) const;

  // Returns the distance from a point in the mesh frame to the nearest triangle within `radius_m`,
  // m; nullopt if there is none.
  std::optional<double> distance(const Eigen::Vector3d& point, double radius_m) const;

  // Returns the maximum vertex error, m; 0 without errors.
  double largest_error_m() const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

}  // namespace libgtd
