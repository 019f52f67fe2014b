// Adjacency of a mesh's triangles along edges (half-edges) and around vertices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Half-edge 3 t + k leads from corner k of triangle t (its source) to the next corner (its target).
using HalfEdge = std::uint32_t;

inline HalfEdge next_in_triangle(HalfEdge h) { return h % 3 == 2 ? h - 2 : h + 1; }
inline HalfEdge previous_in_triangle(HalfEdge h) { return h % 3 == 0 ? h + 2 : h - 1; }
inline std::uint32_t source_of(const std::vector<Triangle>& triangles, HalfEdge h) {
  return triangles[h / 3][h % 3];
}
inline std::uint32_t target_of(const std::vector<Triangle>& triangles, HalfEdge h) {
  return source_of(triangles, next_in_triangle(h));
}
inline Eigen::Vector3d along(const TriangleMesh& mesh, HalfEdge h) {  // from source to target
  return mesh.vertices[target_of(mesh.triangles, h)] - mesh.vertices[source_of(mesh.triangles, h)];
}
inline bool has_repeated_vertex(const Triangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

// Half-edges by undirected edge: edge e has half_edges[first[e]] to half_edges[first[e + 1] - 1],
// ascending. Edges are sorted by their lower, then their higher vertex index. Triangles with a
// repeated vertex have no edges.
struct MeshEdges {
  std::vector<HalfEdge> half_edges;
  std::vector<std::uint32_t> first;

  std::size_t size() const { return first.size() - 1; }
  std::size_t count(std::size_t edge) const { return first[edge + 1] - first[edge]; }
};
// `vertices` is the number of vertices. Throws Error for 1,431,655,764 triangles or more.
MeshEdges edges_of(const std::vector<Triangle>& triangles, std::size_t vertices);

// Opposite of a half-edge: the only other half-edge of the edge, in either direction, or one of:
constexpr HalfEdge open_edge = 0xffffffff;          // no other triangle
constexpr HalfEdge non_manifold_edge = 0xfffffffe;  // more than one other triangle
constexpr HalfEdge no_edge = 0xfffffffd;            // the triangle has a repeated vertex
inline bool is_joined(HalfEdge opposite) { return opposite < no_edge; }  // true: a half-edge
// Opposites of all half-edges, indexed by half-edge.
std::vector<HalfEdge> opposites_of(const std::vector<Triangle>& triangles, const MeshEdges& edges);
inline std::vector<HalfEdge> opposites_of(const TriangleMesh& mesh) {
  return opposites_of(mesh.triangles, edges_of(mesh.triangles, mesh.vertices.size()));
}

// Triangles at each vertex v, ascending: triangles[first[v]] to triangles[first[v + 1] - 1].
struct VertexTriangles {
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> first;
  std::span<const std::uint32_t> of(std::uint32_t v) const {
    return {triangles.data() + first[v], triangles.data() + first[v + 1]};
  }
};
VertexTriangles triangles_at_vertices(const std::vector<Triangle>& triangles, std::size_t vertices);

// Returns for each corner the lowest corner of its fan; a corner has the index of the half-edge
// that starts there. A fan is a set of corners at one vertex whose triangles are connected by
// shared edges at the vertex; a manifold vertex has one fan. `opposite` is opposites_of(mesh).
std::vector<HalfEdge> corner_fans(const std::vector<Triangle>& triangles,
                                  const std::vector<HalfEdge>& opposite);

// Returns chains of half-edges with opposite = open_edge, each beginning with its lowest half-edge.
// For an oriented manifold, the chains are closed boundary loops, followed from target to source of
// each half-edge. If several chains contain a vertex, each follows one fan of triangles.
std::vector<std::vector<HalfEdge>> boundary_loops(const std::vector<Triangle>& triangles,
                                                  const std::vector<HalfEdge>& opposite);

// Also marks triangles that share a vertex with a marked triangle; repeats this `rings` times.
void dilate_mask(const TriangleMesh& mesh, int rings, std::vector<bool>& marks);

// Largest distance between two points, m. For more than 2,000 points it is up to 0.2 % too small.
double diameter_of(const std::vector<Eigen::Vector3d>& points);

}  // namespace libmap
