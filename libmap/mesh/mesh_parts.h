// Parts of meshes: selection, connected components, interpolation of normals, colors and fields.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"

namespace libmap {

// Returns the number of true marks.
std::size_t count_of(const std::vector<bool>& marks);

// Returns the triangles with a true mark and the vertices of these triangles, in the original
// order. Throws Error unless there is one mark per triangle.
TriangleMesh select_triangles(const TriangleMesh& mesh, const std::vector<bool>& keep_triangle);

// Components of triangles connected by shared edges, numbered by ascending first triangle.
struct MeshComponents {
  std::vector<std::uint32_t> of_triangle;  // component number of each triangle
  std::vector<double> areas_m2;            // area of each component
};
MeshComponents connected_components(const TriangleMesh& mesh);
// Returns connected_components(mesh) in a third of the time; `opposite` is opposites_of(mesh).
MeshComponents connected_components(const TriangleMesh& mesh,
                                    const std::vector<HalfEdge>& opposite);

inline bool is_integer(ScalarType type) {
  return type != ScalarType::float32 && type != ScalarType::float64;
}

// Appends a vertex on the segment from a (t = 0) to b (t = 1) and returns its index. Values are
// interpolated linearly, normals are normalized, and integer fields take the nearer end's value.
std::uint32_t append_vertex_between(TriangleMesh& mesh, std::uint32_t a, std::uint32_t b, double t);

// Returns the mesh with positions and normals transformed by `target_from_source`.
TriangleMesh transform_mesh(const TriangleMesh& mesh, const Pose& target_from_source);

inline Eigen::Vector3d center_of(const TriangleMesh& mesh, const Triangle& t) {
  return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0;
}

using TriangleCorners = std::array<Eigen::Vector3d, 3>;
inline TriangleCorners corners_of(const TriangleMesh& mesh, const Triangle& t) {
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}
// Divides a triangle at the midpoints of its sides: the middle part, then the parts at the corners.
std::array<TriangleCorners, 4> quarters_of(const TriangleCorners& corners);

// Point on a triangle: (1 - u - v) * a + u * b + v * c.
struct TrianglePoint {
  std::uint32_t triangle = 0;  // with corners a, b, c
  double u = 0.0;
  double v = 0.0;
};
Eigen::Vector3d position_on(const TriangleMesh& mesh, const TrianglePoint& point);

// Returns `points` as a cloud. Vertex normals, colors and vertex fields are interpolated; integer
// fields take the value of the nearest vertex. Without vertex normals, points have the normals of
// the triangles. Face fields are copied from the triangle.
PointCloud points_on_surface(const TriangleMesh& mesh, const std::vector<TrianglePoint>& points);

}  // namespace libmap
