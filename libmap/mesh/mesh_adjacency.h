// Adjacency of triangles along edges and around vertices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Half-edge 3 t + k runs from corner k of triangle t to the next one.
using HalfEdge = std::uint32_t;

inline HalfEdge next_in_triangle(HalfEdge h) { return h % 3 == 2 ? h - 2 : h + 1; }
inline HalfEdge previous_in_triangle(HalfEdge h) { return h % 3 == 0 ? h + 2 : h - 1; }
inline std::uint32_t source_of(const std::vector<Triangle>& triangles, HalfEdge h) {
  return triangles[h / 3][h % 3];
}
inline std::uint32_t target_of(const std::vector<Triangle>& triangles, HalfEdge h) {
  return source_of(triangles, next_in_triangle(h));
}
inline Eigen::Vector3d along(const TriangleMesh& mesh, HalfEdge h) {
  return mesh.vertices[target_of(mesh.triangles, h)] - mesh.vertices[source_of(mesh.triangles, h)];
}
inline bool names_a_vertex_twice(const Triangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

// The half-edges of each undirected edge: edge e has half_edges[first[e]] .. [first[e + 1] - 1],
// ascending; edges ascend by their lower, then by their higher vertex. Triangles that name a vertex
// twice have none.
struct MeshEdges {
  std::vector<HalfEdge> half_edges;
  std::vector<std::uint32_t> first;

  std::size_t size() const { return first.size() - 1; }
  std::size_t count(std::size_t edge) const { return first[edge + 1] - first[edge]; }
};
// Throws Error if there are more than 2^32 / 3 - 1 triangles. Indices must be in range.
MeshEdges edges_of(const std::vector<Triangle>& triangles, std::size_t vertices);

// For each half-edge the one other half-edge of its edge, in whichever sense that runs, or one of:
constexpr HalfEdge open_edge = 0xffffffff;          // no other triangle
constexpr HalfEdge non_manifold_edge = 0xfffffffe;  // more than one other
constexpr HalfEdge no_edge = 0xfffffffd;            // the triangle names a vertex twice
inline bool is_joined(HalfEdge opposite) { return opposite < no_edge; }
// One for each half-edge, in their order.
std::vector<HalfEdge> opposites_of(const std::vector<Triangle>& triangles, const MeshEdges& edges);
inline std::vector<HalfEdge> opposites_of(const TriangleMesh& mesh) {
  return opposites_of(mesh.triangles, edges_of(mesh.triangles, mesh.vertices.size()));
}

// The triangles at each vertex, ascending: triangles[first[v]] .. triangles[first[v + 1] - 1].
struct VertexTriangles {
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> first;
  std::span<const std::uint32_t> of(std::uint32_t v) const {
    return {triangles.data() + first[v], triangles.data() + first[v + 1]};
  }
};
VertexTriangles triangles_at_vertices(const std::vector<Triangle>& triangles, std::size_t vertices);

// Corners (numbered as half-edges) that are joined around their vertex over `opposite`, as sets:
// each corner's set is named by the lowest corner in it. A vertex of one fan has one set.
std::vector<HalfEdge> corner_fans(const std::vector<Triangle>& triangles,
                                  const std::vector<HalfEdge>& opposite);

// Chains of open half-edges, each from its lowest one on; of an oriented manifold closed loops of
// boundary, against the sense of the triangles inside (from target to source). Where more than one
// chain passes a vertex, each stays with its fan of triangles.
std::vector<std::vector<HalfEdge>> boundary_loops(const std::vector<Triangle>& triangles,
                                                  const std::vector<HalfEdge>& opposite);

// Marks, `rings` times, the triangles that have a vertex in common with a marked one.
void grow_marks(const TriangleMesh& mesh, int rings, std::vector<bool>& marks);

// Largest distance between two of the points, m; of more than 2,000 points at most 0.2 % too short.
double diameter_of(const std::vector<Eigen::Vector3d>& points);

}  // namespace libmap
