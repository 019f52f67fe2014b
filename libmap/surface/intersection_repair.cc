#include "libmap/surface/intersection_repair.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/hole_filling.h"
#include "libmap/surface/mesh_manifold.h"
#include "libmap/surface/self_intersections.h"
#include "libmap/surface/triangle_repair.h"

namespace libmap {

namespace {

constexpr int closing_rounds = 4;
constexpr int max_rounds = 30;

// Fields that only this file sees, while it works: no file has fields of such names.
constexpr std::string_view boundary_field = "\x01on a boundary before";
constexpr std::string_view component_field = "\x01component";

// `filled` while this works: what was marked before keeps apart from what is put in now.
constexpr double filled_before = 2.0;

ScalarField& field_named(std::vector<ScalarField>& fields, std::string_view name) {
  return *std::find_if(fields.begin(), fields.end(),
                       [&](const ScalarField& field) { return field.name == name; });
}

void erase_field(std::vector<ScalarField>& fields, std::string_view name) {
  std::erase_if(fields, [&](const ScalarField& field) { return field.name == name; });
}

std::vector<BoundaryLoop> loops_of(const TriangleMesh& mesh) {
  return boundary_loops(mesh.triangles, opposites_of(mesh));
}

// Intersecting and degenerate triangles.
std::vector<bool> faulty_triangles(const TriangleMesh& mesh) {
  std::vector<bool> marks = degenerate_triangles(mesh);
  for (const TrianglePair& pair : find_self_intersections(mesh))
    marks[pair.first] = marks[pair.second] = true;
  return marks;
}

// The pieces that removing triangles of `removed_m2` has cut off: smaller than that, and not the
// largest piece of what was one component. `component_field` names the component of each triangle.
void drop_scraps(TriangleMesh& mesh, std::size_t components_before, double removed_m2) {
  const ScalarField& former = field_named(mesh.face_fields, component_field);
  const MeshComponents pieces = connected_components(mesh);
  std::vector<std::size_t> former_of(pieces.areas_m2.size());
  std::vector<double> largest(components_before, 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t piece = pieces.of_triangle[t];
    former_of[piece] = static_cast<std::size_t>(former.values[t]);
    double& area = largest[former_of[piece]];
    area = std::max(area, pieces.areas_m2[piece]);
  }
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) {
    const std::uint32_t piece = pieces.of_triangle[t];
    const double area = pieces.areas_m2[piece];
    keep[t] = area > removed_m2 || area >= largest[former_of[piece]];
  }
  if (count_of(keep) < keep.size()) mesh = select_triangles(mesh, keep);
}

// Loops that touch no boundary that was there before.
std::vector<BoundaryLoop> new_loops(const TriangleMesh& mesh) {
  const ScalarField* before = nullptr;
  for (const ScalarField& field : mesh.vertex_fields)
    if (field.name == boundary_field) before = &field;
  std::vector<BoundaryLoop> loops = loops_of(mesh);
  std::erase_if(loops, [&](const BoundaryLoop& loop) {
    return std::any_of(loop.begin(), loop.end(), [&](HalfEdge h) {
      return before->values[source_of(mesh.triangles, h)] != 0.0;
    });
  });
  return loops;
}

void mark_boundary(TriangleMesh& mesh) {
  ScalarField marks{std::string(boundary_field), ScalarType::uint8,
                    std::vector<double>(mesh.vertices.size(), 0.0)};
  for (const BoundaryLoop& loop : loops_of(mesh))
    for (const HalfEdge h : loop) marks.values[source_of(mesh.triangles, h)] = 1.0;
  mesh.vertex_fields.push_back(std::move(marks));
}

void remove(TriangleMesh& mesh, std::vector<bool> marks, int rings, double min_gap_m) {
  grow_marks(mesh, rings, marks);
  const MeshComponents components = connected_components(mesh);
  mesh.face_fields.push_back(
      {std::string(component_field), ScalarType::float64,
       std::vector<double>(components.of_triangle.begin(), components.of_triangle.end())});
  double removed_m2 = 0.0;
  for (std::size_t t = 0; t < marks.size(); ++t)
    if (marks[t]) removed_m2 += area_normal(mesh, mesh.triangles[t]).norm() / 2.0;
  marks.flip();
  mesh = select_triangles(mesh, marks);
  drop_scraps(mesh, components.areas_m2.size(), removed_m2);
  make_manifold(mesh, min_gap_m);
  erase_field(mesh.face_fields, component_field);
}

}  // namespace

IntersectionRepair repair_intersections(TriangleMesh& mesh, double min_gap_m) {
  IntersectionRepair result;
  std::vector<bool> faulty = faulty_triangles(mesh);
  if (count_of(faulty) == 0) return result;
  mark_boundary(mesh);
  for (double& mark : filled_marks(mesh).values)
    if (mark != 0.0) mark = filled_before;
  for (int round = 0; round < max_rounds && count_of(faulty) > 0; ++round) {
    result.faulty_triangles += count_of(faulty);
    const bool closes = round < closing_rounds;
    remove(mesh, faulty, closes ? round + 1 : 0, min_gap_m);
    if (closes) fill_holes(mesh, new_loops(mesh), PatchCheck::manifold);
    faulty = faulty_triangles(mesh);
  }
  result.remaining_triangles = count_of(faulty);
  result.open_places = new_loops(mesh).size();
  for (double& mark : filled_marks(mesh).values) {
    if (mark == 1.0) ++result.closing_triangles;
    if (mark != 0.0) mark = 1.0;
  }
  erase_field(mesh.vertex_fields, boundary_field);
  return result;
}

}  // namespace libmap
