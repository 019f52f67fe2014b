// Parts of a mesh with all that belongs to their vertices and faces: normals, colors, fields.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"

namespace libmap {

// How many are marked.
std::size_t count_of(const std::vector<bool>& marks);

// The triangles that are marked, in their order, and the vertices that they use, in theirs.
// `keep_triangle` is one a triangle.
TriangleMesh select_triangles(const TriangleMesh& mesh, const std::vector<bool>& keep_triangle);

// Connected components over shared edges, numbered by their first triangle.
struct MeshComponents {
  std::vector<std::uint32_t> of_triangle;
  std::vector<double> areas_m2;  // of each component
};
MeshComponents connected_components(const TriangleMesh& mesh);
// The same where its half-edges are known (opposites_of): a hash table of all edges takes three
// times as long.
MeshComponents connected_components(const TriangleMesh& mesh,
                                    const std::vector<HalfEdge>& opposite);

inline bool is_whole(ScalarType type) {
  return type != ScalarType::float32 && type != ScalarType::float64;
}

// A new vertex on the segment from a (t = 0) to b (t = 1), all of its values interpolated linearly;
// normals are made unit again. Fields of whole numbers take the nearer end's value.
std::uint32_t append_vertex_between(TriangleMesh& mesh, std::uint32_t a, std::uint32_t b, double t);

// Positions, unit normals and a known viewpoint carried by `target_from_source`.
TriangleMesh transform_mesh(const TriangleMesh& mesh, const Pose& target_from_source);

inline Eigen::Vector3d center_of(const TriangleMesh& mesh, const Triangle& t) {
  return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0;
}

// A place on a triangle: (1 - u - v) * a + u * b + v * c.
struct TrianglePoint {
  std::uint32_t triangle = 0;
  double u = 0.0;
  double v = 0.0;
};
Eigen::Vector3d position_on(const TriangleMesh& mesh, const TrianglePoint& point);

// The surface at `points` as a cloud: unit normals (of the vertices, interpolated, or else of the
// triangle), colors and vertex fields by barycentric interpolation, face fields of the triangle.
// Fields of whole numbers take the nearest vertex's value.
PointCloud points_on_surface(const TriangleMesh& mesh, const std::vector<TrianglePoint>& points);

}  // namespace libmap
