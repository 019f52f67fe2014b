// Report on the topology and defects of a mesh, for `graspmap info` and `graspmap mesh --report`.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/result_table.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct MeshReportOptions {
  bool self_intersections = true;  // count self-intersections, which takes most of the time
};

// Closed chain of edges that belong to one triangle only.
struct MeshBoundary {
  std::size_t edges = 0;
  double length_m = 0.0;
  double diameter_m = 0.0;  // largest distance between two vertices
};

struct EdgeLengths {
  double min_m = 0.0;
  double median_m = 0.0;
  double max_m = 0.0;
};

// Counts of edges, fans and used vertices ignore triangles with a repeated vertex.
struct MeshReport {
  std::size_t vertices = 0;
  std::size_t unused_vertices = 0;  // vertices without an edge
  std::size_t triangles = 0;
  std::size_t filled_triangles = 0;      // face field `filled` is 1
  std::size_t degenerate_triangles = 0;  // repeated vertex, or height below 1e-9 of the mesh's size
  std::size_t duplicate_triangles = 0;   // corners as of an earlier triangle, in any order
  double area_m2 = 0.0;
  double largest_component_area_m2 = 0.0;
  std::size_t components = 0;  // sets of triangles that are connected by edges
  EdgeLengths edge_lengths;

  std::size_t edges = 0;               // undirected
  std::size_t non_manifold_edges = 0;  // edges with more than two triangles
  // Vertices with more than one fan of triangles, without the vertices of non-manifold edges.
  std::size_t non_manifold_vertices = 0;
  std::size_t misoriented_edges = 0;     // two triangles run along the edge in the same direction
  std::size_t boundary_edges = 0;        // edges with one triangle
  std::vector<MeshBoundary> boundaries;  // longest first
  // Pairs of triangles that intersect in more than common corners or edges; 0 if not counted.
  std::size_t self_intersections = 0;
  bool self_intersections_counted = false;

  bool is_manifold() const { return non_manifold_edges == 0 && non_manifold_vertices == 0; }
  bool is_oriented() const { return misoriented_edges == 0; }
  // True if every edge has two triangles.
  bool is_closed() const { return triangles > 0 && boundary_edges == 0 && non_manifold_edges == 0; }
  // True if closed, manifold, oriented and without known self-intersections.
  bool is_watertight() const {
    return is_closed() && is_manifold() && is_oriented() && self_intersections == 0;
  }
  long euler_characteristic = 0;  // used vertices - edges + triangles without a repeated vertex
  // Sum of the components' genera, with each boundary closed by a disc: components -
  // (euler_characteristic + boundaries) / 2. -1 if not manifold or not oriented.
  long genus = -1;
  // Enclosed volume, negative for inward normals. 0 if not closed, not manifold or not oriented.
  double volume_m3 = 0.0;
};
void describe(ResultTable& table, const MeshReport& report);

// Reports on a mesh; all counts are 0 without triangles. The result does not depend on the number
// of threads. Throws Error as require_sound (mesh_repair.h).
MeshReport report_mesh(const TriangleMesh& mesh, const MeshReportOptions& options = {});

}  // namespace libmap
