#include "libmap/surface/mesh_report.h"

#include <algorithm>
#include <cstdint>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/hole_filling.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/surface/self_intersections.h"

namespace libmap {

namespace {

void report_triangles(const TriangleMesh& mesh, MeshReport& report) {
  report.vertices = mesh.vertices.size();
  report.triangles = mesh.triangles.size();
  report.area_m2 = surface_area(mesh);
  report.degenerate_triangles = count_of(degenerate_triangles(mesh));
  report.duplicate_triangles = count_of(repeated_triangles(mesh.triangles));
  if (const ScalarField* filled = find_field(mesh.face_fields, filled_field))
    report.filled_triangles = static_cast<std::size_t>(std::count_if(
        filled->values.begin(), filled->values.end(), [](double v) { return v > 0.0; }));
  const MeshComponents components = connected_components(mesh);
  report.components = components.areas_m2.size();
  for (const double area : components.areas_m2)
    report.largest_component_area_m2 = std::max(report.largest_component_area_m2, area);
}

void report_edges(const TriangleMesh& mesh, const MeshEdges& edges, MeshReport& report) {
  report.edges = edges.size();
  std::vector<double> lengths;
  lengths.reserve(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const HalfEdge* half = &edges.half_edges[edges.first[e]];
    lengths.push_back(along(mesh, half[0]).norm());
    const std::size_t count = edges.count(e);
    if (count == 1) ++report.boundary_edges;
    if (count > 2) ++report.non_manifold_edges;
    if (count == 2 && source_of(mesh.triangles, half[0]) == source_of(mesh.triangles, half[1]))
      ++report.misoriented_edges;
  }
  if (lengths.empty()) return;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  report.edge_lengths = {.min_m = *std::min_element(lengths.begin(), middle + 1),
                         .median_m = *middle,
                         .max_m = *std::max_element(middle, lengths.end())};
}

void report_vertices(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                     MeshReport& report) {
  enum class State : std::uint8_t { unused, one_fan, several_fans, at_bad_edge };
  std::vector<State> states(mesh.vertices.size(), State::unused);
  std::vector<HalfEdge> fan_of(mesh.vertices.size(), open_edge);
  const std::vector<HalfEdge> fans = corner_fans(mesh.triangles, opposite);
  for (HalfEdge corner = 0; corner < fans.size(); ++corner) {
    if (opposite[corner] == no_edge) continue;
    const std::uint32_t v = source_of(mesh.triangles, corner);
    if (states[v] == State::unused) {
      states[v] = State::one_fan;
      fan_of[v] = fans[corner];
    } else if (states[v] == State::one_fan && fan_of[v] != fans[corner]) {
      states[v] = State::several_fans;
    }
  }
  for (HalfEdge h = 0; h < opposite.size(); ++h)
    if (opposite[h] == non_manifold_edge)
      for (const std::uint32_t v : {source_of(mesh.triangles, h), target_of(mesh.triangles, h)})
        states[v] = State::at_bad_edge;
  const auto number = [&](State state) {
    return static_cast<std::size_t>(std::count(states.begin(), states.end(), state));
  };
  report.unused_vertices = number(State::unused);
  report.non_manifold_vertices = number(State::several_fans);
}

void report_boundaries(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                       MeshReport& report) {
  for (const std::vector<HalfEdge>& loop : boundary_loops(mesh.triangles, opposite)) {
    MeshBoundary& boundary = report.boundaries.emplace_back();
    std::vector<Eigen::Vector3d> positions;
    for (const HalfEdge h : loop) {
      boundary.length_m += along(mesh, h).norm();
      positions.push_back(mesh.vertices[source_of(mesh.triangles, h)]);
      positions.push_back(mesh.vertices[target_of(mesh.triangles, h)]);
    }
    boundary.edges = loop.size();
    boundary.diameter_m = diameter_of(positions);
  }
  std::stable_sort(
      report.boundaries.begin(), report.boundaries.end(),
      [](const MeshBoundary& a, const MeshBoundary& b) { return a.length_m > b.length_m; });
}

void report_topology(const TriangleMesh& mesh, MeshReport& report) {
  const auto with_edges =
      static_cast<long>(std::count_if(mesh.triangles.begin(), mesh.triangles.end(),
                                      [](const Triangle& t) { return !has_repeated_vertex(t); }));
  const auto used = static_cast<long>(report.vertices - report.unused_vertices);
  report.euler_characteristic = used - static_cast<long>(report.edges) + with_edges;
  const bool has_genus = with_edges == static_cast<long>(report.triangles) && with_edges > 0 &&
                         report.is_manifold() && report.is_oriented();
  if (!has_genus) return;
  report.genus = static_cast<long>(report.components) -
                 (report.euler_characteristic + static_cast<long>(report.boundaries.size())) / 2;
  if (report.is_closed()) report.volume_m3 = signed_volume(mesh);
}

}  // namespace

MeshReport report_mesh(const TriangleMesh& mesh, const MeshReportOptions& options) {
  require_sound(mesh);
  MeshReport report;
  report_triangles(mesh, report);
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  report_edges(mesh, edges, report);
  const std::vector<HalfEdge> opposite = opposites_of(mesh.triangles, edges);
  report_vertices(mesh, opposite, report);
  report_boundaries(mesh, opposite, report);
  report_topology(mesh, report);
  report.self_intersections_counted = options.self_intersections;
  if (options.self_intersections) report.self_intersections = find_self_intersections(mesh).size();
  return report;
}

void describe(ResultTable& table, const MeshReport& report) {
  std::vector<double> lengths_m;
  for (const MeshBoundary& boundary : report.boundaries) lengths_m.push_back(boundary.length_m);
  table.add("watertight", report.is_watertight(), "closed, manifold, oriented, not intersecting");
  table.add("manifold", report.is_manifold(),
            "true if every edge has at most two triangles and every vertex one fan of triangles");
  table.add("oriented", report.is_oriented(), "true if neighbor triangles agree in orientation");
  table.add("components", report.components, "number of components connected by edges");
  table.add("genus", report.genus, "number of handles if manifold and oriented, otherwise -1");
  table.add("boundaries", lengths_m.size(), "number of closed chains of boundary edges");
  table.add("boundary_lengths_m", lengths_m, "length of each boundary, longest first, m");
  table.add("area_m2", report.area_m2, "area of the mesh, m2");
  table.add("non_manifold_edges", report.non_manifold_edges,
            "number of edges with more than two triangles");
  table.add("non_manifold_vertices", report.non_manifold_vertices,
            "number of vertices with more than one fan of triangles");
  table.add("self_intersections", report.self_intersections,
            "number of pairs of intersecting triangles");
  table.add("median_edge_m", report.edge_lengths.median_m, "median length of the edges, m");
}

}  // namespace libmap
