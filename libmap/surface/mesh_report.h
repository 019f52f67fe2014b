// What a triangle mesh is as a surface: its parts, boundaries, genus, and what is wrong with it.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/result_table.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct MeshReportOptions {
  // Takes most of the time.
  bool self_intersections = true;
};

// A closed chain of edges that have a triangle on one side alone.
struct MeshBoundary {
  std::size_t edges = 0;
  double length_m = 0.0;
  double diameter_m = 0.0;  // largest distance between two of its vertices
};

struct EdgeLengths {
  double min_m = 0.0;
  double median_m = 0.0;
  double max_m = 0.0;
};

// Triangles that name a vertex twice count as degenerate and stand outside of all else.
struct MeshReport {
  std::size_t vertices = 0;
  std::size_t unused_vertices = 0;  // of no triangle
  std::size_t triangles = 0;
  std::size_t filled_triangles = 0;      // of the face field `filled`
  std::size_t degenerate_triangles = 0;  // a vertex twice, or lower than 1e-9 of the mesh's size
  std::size_t duplicate_triangles = 0;   // the corners of an earlier one, in any order
  double area_m2 = 0.0;
  double largest_component_area_m2 = 0.0;
  std::size_t components = 0;  // connected over edges
  EdgeLengths edge_lengths;

  std::size_t edges = 0;
  std::size_t non_manifold_edges = 0;     // of more than two triangles
  std::size_t non_manifold_vertices = 0;  // whose triangles are not one fan, such edges apart
  std::size_t misoriented_edges = 0;      // whose two triangles run along it in the same sense
  std::size_t boundary_edges = 0;
  std::vector<MeshBoundary> boundaries;  // longest first
  // Pairs of triangles that meet in more than the corners or the edge that they share; 0 if they
  // were not looked for.
  std::size_t self_intersections = 0;
  bool self_intersections_counted = false;

  bool is_manifold() const { return non_manifold_edges == 0 && non_manifold_vertices == 0; }
  bool is_oriented() const { return misoriented_edges == 0; }
  // Every edge has two triangles.
  bool is_closed() const { return triangles > 0 && boundary_edges == 0 && non_manifold_edges == 0; }
  // Closed, manifold, oriented, and as far as is known without self-intersections.
  bool is_watertight() const {
    return is_closed() && is_manifold() && is_oriented() && self_intersections == 0;
  }
  long euler_characteristic = 0;  // used vertices - edges + triangles
  // Of a manifold and oriented mesh, the sum over its components, each boundary closed by a disc:
  // components - (euler_characteristic + boundaries) / 2. Else -1.
  long genus = -1;
  // Enclosed by a mesh that is closed, manifold and oriented, else 0. Negative: inside out.
  double volume_m3 = 0.0;
};
void describe(ResultTable& table, const MeshReport& report);

// Throws Error: an index out of range, a vertex that is not finite. A mesh without triangles has a
// report of zeros. The same for any number of threads.
MeshReport report_mesh(const TriangleMesh& mesh, const MeshReportOptions& options = {});

}  // namespace libmap
