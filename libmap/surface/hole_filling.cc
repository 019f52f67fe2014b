#include "libmap/surface/hole_filling.h"

#define CGAL_EIGEN3_ENABLED
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <iterator>
#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/surface/self_intersections.h"

namespace libmap {

namespace {

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

// Longer boundaries stay open: the time of triangulation may grow with the square of the edges.
constexpr std::size_t max_hole_edges = 5000;

// Rings of triangles around a hole to which its patch is fitted; boundary curvature needs one.
constexpr int rings = 2;

// Larger holes are triangulated only over their Delaunay triangulation, because the time of a
// search over all triangulations grows with the cube of the number of edges.
constexpr std::size_t max_cubic_edges = 150;

// Type of a patch.
enum class PatchShape {
  faired,        // continues the tangent planes of the surface around it (C1)
  refined,       // triangles of the size of those around the hole
  triangulated,  // no new vertices
};
constexpr std::array<PatchShape, 3> shapes = {PatchShape::faired, PatchShape::refined,
                                              PatchShape::triangulated};

// Patch of a hole. Indices count the vertices of the surroundings, then `new_vertices`.
struct HolePatch {
  std::vector<Eigen::Vector3d> new_vertices;
  std::vector<Triangle> triangles;  // empty: no patch was found
};

// Adds vertices and triangles to `mesh`. Returns false if they are not manifold.
bool enter(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& triangles,
           Mesh& mesh) {
  for (const Eigen::Vector3d& v : vertices) mesh.add_vertex({v.x(), v.y(), v.z()});
  const auto vertex = [](std::uint32_t v) { return Mesh::Vertex_index(v); };
  for (const Triangle& t : triangles)
    if (mesh.add_face(vertex(t[0]), vertex(t[1]), vertex(t[2])) == Mesh::null_face()) return false;
  return true;
}

std::size_t edges_around(const Mesh& mesh, Mesh::Halfedge_index h) {
  std::size_t count = 1;
  for (auto at = mesh.next(h); at != h && count <= mesh.number_of_halfedges(); at = mesh.next(at))
    ++count;
  return count;
}

std::vector<Mesh::Face_index> fill(Mesh& mesh, Mesh::Halfedge_index border, PatchShape shape) {
  std::vector<Mesh::Face_index> faces;
  std::vector<Mesh::Vertex_index> vertices;
  const auto parameters =
      CGAL::parameters::do_not_use_cubic_algorithm(edges_around(mesh, border) > max_cubic_edges);
  if (shape == PatchShape::triangulated)
    processing::triangulate_hole(mesh, border, std::back_inserter(faces), parameters);
  else
    processing::triangulate_and_refine_hole(mesh, border, std::back_inserter(faces),
                                            std::back_inserter(vertices), parameters);
  if (shape == PatchShape::faired &&
      !processing::fair(mesh, vertices, CGAL::parameters::fairing_continuity(1)))
    faces.clear();
  return faces;
}

HolePatch patch_from(const Mesh& mesh, const std::vector<Mesh::Face_index>& faces,
                     std::size_t old_vertices) {
  HolePatch patch;
  for (const Mesh::Face_index face : faces) {
    Triangle& triangle = patch.triangles.emplace_back();
    std::size_t k = 0;
    for (const Mesh::Vertex_index v : mesh.vertices_around_face(mesh.halfedge(face)))
      if (k < 3) triangle[k++] = static_cast<std::uint32_t>(v);
  }
  for (std::size_t v = old_vertices; v < mesh.number_of_vertices(); ++v) {
    const Kernel::Point_3& p = mesh.point(Mesh::Vertex_index(static_cast<std::uint32_t>(v)));
    patch.new_vertices.emplace_back(p.x(), p.y(), p.z());
  }
  return patch;
}

// Triangulates the boundary (Liepa 2003, "Filling holes in meshes"; over a Delaunay triangulation
// if that contains a solution), refines and fairs it. `surroundings` are the triangles near the
// hole, an oriented manifold with the boundary half-edge from `from` to `to`. Returns an empty
// patch if the hole cannot be filled.
HolePatch patch_hole(const std::vector<Eigen::Vector3d>& vertices,
                     const std::vector<Triangle>& surroundings, std::uint32_t from,
                     std::uint32_t to, PatchShape shape) {
  try {
    Mesh mesh;
    if (!enter(vertices, surroundings, mesh)) return {};
    const Mesh::Halfedge_index inside =
        mesh.halfedge(Mesh::Vertex_index(from), Mesh::Vertex_index(to));
    if (inside == Mesh::null_halfedge()) return {};
    const Mesh::Halfedge_index border = mesh.opposite(inside);
    if (!mesh.is_border(border)) return {};
    return patch_from(mesh, fill(mesh, border, shape), vertices.size());
  } catch (const std::exception&) {
    // CGAL throws several types of exceptions for unsuitable geometry.
    return {};
  }
}

std::vector<Eigen::Vector3d> positions_of(const TriangleMesh& mesh, const BoundaryLoop& loop) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(loop.size());
  for (const HalfEdge h : loop) positions.push_back(mesh.vertices[source_of(mesh.triangles, h)]);
  return positions;
}

double length_of(const TriangleMesh& mesh, const BoundaryLoop& loop) {
  double length = 0.0;
  for (const HalfEdge h : loop) length += along(mesh, h).norm();
  return length;
}

struct Reach {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double of_boundary_m = 0.0;
  double of_component_m = 0.0;
};

// For each loop, true if it is the outer boundary of its component.
std::vector<bool> outer_boundaries(const TriangleMesh& mesh, const MeshComponents& components,
                                   const std::vector<BoundaryLoop>& loops,
                                   const std::optional<XyBox>& known) {
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> longest(components.areas_m2.size(), none);
  std::vector<double> length(components.areas_m2.size(), -1.0);
  for (std::size_t n = 0; n < loops.size(); ++n) {
    const std::uint32_t component = components.of_triangle[loops[n].front() / 3];
    const double here = length_of(mesh, loops[n]);
    if (here <= length[component]) continue;
    length[component] = here;
    longest[component] = n;
  }
  std::vector<Reach> reach(components.areas_m2.size());
  for (std::size_t c = 0; c < reach.size(); ++c) {
    if (longest[c] == none) continue;
    const std::vector<Eigen::Vector3d> boundary = positions_of(mesh, loops[longest[c]]);
    for (const Eigen::Vector3d& p : boundary) reach[c].middle += p;
    reach[c].middle /= static_cast<double>(boundary.size());
    for (const Eigen::Vector3d& p : boundary)
      reach[c].of_boundary_m = std::max(reach[c].of_boundary_m, (p - reach[c].middle).norm());
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Reach& here = reach[components.of_triangle[t]];
    for (const std::uint32_t v : mesh.triangles[t])
      here.of_component_m = std::max(here.of_component_m, (mesh.vertices[v] - here.middle).norm());
  }
  const std::vector<bool> are_beyond = components_beyond(mesh, components, known);
  std::vector<bool> is_outer(loops.size(), false);
  for (std::size_t c = 0; c < reach.size(); ++c)
    if (longest[c] != none && !are_beyond[c] &&
        2.0 * reach[c].of_boundary_m >= reach[c].of_component_m)
      is_outer[longest[c]] = true;
  return is_outer;
}

// A patch whose indices below `vertices.size()` refer to `vertices`, which are indices of the mesh.
struct PlacedPatch {
  std::vector<std::uint32_t> vertices;
  HolePatch patch;
  bool found() const { return !patch.triangles.empty(); }
};

// Vertices of the triangles, ascending.
std::vector<std::uint32_t> named_vertices(const std::vector<Triangle>& triangles) {
  std::vector<std::uint32_t> vertices;
  for (const Triangle& t : triangles) vertices.insert(vertices.end(), t.begin(), t.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

std::uint32_t index_in(const std::vector<std::uint32_t>& sorted, std::uint32_t value) {
  return static_cast<std::uint32_t>(std::lower_bound(sorted.begin(), sorted.end(), value) -
                                    sorted.begin());
}

class HolePatcher {
 public:
  explicit HolePatcher(const TriangleMesh& mesh)
      : mesh_(mesh),
        around_(triangles_at_vertices(mesh.triangles, mesh.vertices.size())),
        lowest_height_(degenerate_height * size_of(mesh)) {}

  PlacedPatch patch(const BoundaryLoop& loop, PatchShape shape) const {
    if (loop.size() < 3 || loop.size() > max_hole_edges) return {};
    std::vector<Triangle> triangles = surroundings(loop);
    PlacedPatch result;
    result.vertices = named_vertices(triangles);
    std::vector<Eigen::Vector3d> positions;
    for (const std::uint32_t v : result.vertices) positions.push_back(mesh_.vertices[v]);
    for (Triangle& t : triangles)
      for (std::uint32_t& v : t) v = index_in(result.vertices, v);
    result.patch = patch_hole(
        positions, triangles, index_in(result.vertices, source_of(mesh_.triangles, loop[0])),
        index_in(result.vertices, target_of(mesh_.triangles, loop[0])), shape);
    if (!is_valid(positions, triangles, result.patch)) result.patch = {};
    return result;
  }

 private:
  std::vector<Triangle> surroundings(const BoundaryLoop& loop) const {
    std::vector<std::uint32_t> vertices;
    for (const HalfEdge h : loop) vertices.push_back(source_of(mesh_.triangles, h));
    std::vector<std::uint32_t> numbers;
    std::vector<Triangle> triangles;
    for (int ring = 0; ring < rings; ++ring) {
      numbers.clear();
      for (const std::uint32_t v : vertices)
        numbers.insert(numbers.end(), around_.of(v).begin(), around_.of(v).end());
      std::sort(numbers.begin(), numbers.end());
      numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
      triangles.clear();
      for (const std::uint32_t t : numbers) triangles.push_back(mesh_.triangles[t]);
      vertices = named_vertices(triangles);
    }
    return triangles;
  }

  // True if each edge of the patch has two triangles, and no triangle is degenerate.
  bool is_valid(const std::vector<Eigen::Vector3d>& positions, const std::vector<Triangle>& around,
                const HolePatch& patch) const {
    TriangleMesh joined;
    joined.vertices = positions;
    joined.vertices.insert(joined.vertices.end(), patch.new_vertices.begin(),
                           patch.new_vertices.end());
    for (const Eigen::Vector3d& v : patch.new_vertices)
      if (!v.allFinite()) return false;
    joined.triangles = around;
    joined.triangles.insert(joined.triangles.end(), patch.triangles.begin(), patch.triangles.end());
    const std::vector<HalfEdge> opposite = opposites_of(joined);
    for (std::size_t t = around.size(); t < joined.triangles.size(); ++t) {
      if (lowest_height(joined, joined.triangles[t]) <= lowest_height_) return false;
      for (HalfEdge h = static_cast<HalfEdge>(3 * t); h < 3 * t + 3; ++h)
        if (!is_joined(opposite[h]) ||
            source_of(joined.triangles, h) == source_of(joined.triangles, opposite[h]))
          return false;
    }
    return true;
  }

  const TriangleMesh& mesh_;
  VertexTriangles around_;
  double lowest_height_;
};

// Appends a vertex with values interpolated from the vertices of the boundary.
void append_patch_vertex(TriangleMesh& mesh, const Eigen::Vector3d& position,
                         const std::vector<std::uint32_t>& boundary) {
  std::vector<double> weights;
  double sum = 0.0;
  for (const std::uint32_t v : boundary) {
    weights.push_back(1.0 / std::max((mesh.vertices[v] - position).squaredNorm(),
                                     std::numeric_limits<double>::min()));
    sum += weights.back();
  }
  const std::uint32_t nearest = boundary[static_cast<std::size_t>(
      std::max_element(weights.begin(), weights.end()) - weights.begin())];
  const std::uint32_t added = append_vertex_between(mesh, nearest, nearest, 0.0);
  mesh.vertices[added] = position;
  const auto mean = [&](const auto& value_of) {
    double total = 0.0;
    for (std::size_t n = 0; n < boundary.size(); ++n)
      total += weights[n] / sum * static_cast<double>(value_of(boundary[n]));
    return total;
  };
  if (!mesh.vertex_colors.empty())
    for (std::size_t c = 0; c < 3; ++c)
      mesh.vertex_colors[added][c] = static_cast<std::uint8_t>(std::clamp(
          std::lround(mean([&](std::uint32_t v) { return mesh.vertex_colors[v][c]; })), 0L, 255L));
  for (ScalarField& field : mesh.vertex_fields)
    if (!is_integer(field.type))
      field.values[added] = mean([&](std::uint32_t v) { return field.values[v]; });
}

// Triangle at the edge of the boundary nearest to `near_to`.
std::uint32_t nearest_triangle(const TriangleMesh& mesh, const BoundaryLoop& loop,
                               const Eigen::Vector3d& near_to) {
  double nearest = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = loop.front() / 3;
  for (const HalfEdge h : loop) {
    const Eigen::Vector3d middle = (mesh.vertices[source_of(mesh.triangles, h)] +
                                    mesh.vertices[target_of(mesh.triangles, h)]) /
                                   2.0;
    const double here = (middle - near_to).squaredNorm();
    if (here >= nearest) continue;
    nearest = here;
    triangle = h / 3;
  }
  return triangle;
}

void append_patch(TriangleMesh& mesh, const BoundaryLoop& loop, const PlacedPatch& placed) {
  std::vector<std::uint32_t> boundary;
  for (const HalfEdge h : loop) boundary.push_back(source_of(mesh.triangles, h));
  const auto first_new = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3d& position : placed.patch.new_vertices)
    append_patch_vertex(mesh, position, boundary);
  const auto old_count = static_cast<std::uint32_t>(placed.vertices.size());
  for (Triangle triangle : placed.patch.triangles) {
    for (std::uint32_t& v : triangle)
      v = v < old_count ? placed.vertices[v] : first_new + (v - old_count);
    const Eigen::Vector3d near_to = center_of(mesh, triangle);
    const std::uint32_t source = nearest_triangle(mesh, loop, near_to);
    mesh.triangles.push_back(triangle);
    for (ScalarField& field : mesh.face_fields)
      field.values.push_back(field.name == filled_field ? 1.0 : field.values[source]);
  }
}

// For each patch, true if it intersects no triangle except its neighbors.
std::vector<bool> free_patches(const TriangleMesh& base, const std::vector<BoundaryLoop>& holes,
                               const std::vector<PlacedPatch>& patches) {
  TriangleMesh trial;
  trial.vertices = base.vertices;
  trial.triangles = base.triangles;
  std::vector<bool> is_new(base.triangles.size(), false);
  std::vector<std::size_t> patch_of;
  for (std::size_t n = 0; n < holes.size(); ++n) {
    append_patch(trial, holes[n], patches[n]);
    patch_of.resize(trial.triangles.size() - base.triangles.size(), n);
  }
  is_new.resize(trial.triangles.size(), true);
  std::vector<bool> is_free(holes.size(), true);
  for (const TrianglePair& pair : find_self_intersections(trial, is_new))
    for (const std::uint32_t t : {pair.first, pair.second})
      if (t >= base.triangles.size()) is_free[patch_of[t - base.triangles.size()]] = false;
  return is_free;
}

}  // namespace

std::vector<bool> components_beyond(const TriangleMesh& mesh, const MeshComponents& components,
                                    const std::optional<XyBox>& known) {
  std::vector<bool> are_beyond(components.areas_m2.size(), false);
  if (!known) return are_beyond;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t])
      if (!known->contains(mesh.vertices[v].head<2>()))
        are_beyond[components.of_triangle[t]] = true;
  return are_beyond;
}

std::vector<BoundaryLoop> find_holes(const TriangleMesh& mesh, double max_hole_m,
                                     const std::optional<XyBox>& known) {
  const std::vector<HalfEdge> opposite = opposites_of(mesh);
  std::vector<BoundaryLoop> loops = boundary_loops(mesh.triangles, opposite);
  if (loops.empty()) return {};
  const std::vector<bool> is_outer =
      outer_boundaries(mesh, connected_components(mesh, opposite), loops, known);
  std::vector<BoundaryLoop> holes;
  for (std::size_t n = 0; n < loops.size(); ++n) {
    if (is_outer[n]) continue;
    const std::vector<Eigen::Vector3d> positions = positions_of(mesh, loops[n]);
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : positions) box.extend(p);
    if (known && !known->contains(XyBox(box.min().head<2>(), box.max().head<2>()))) continue;
    // The longest side of the box is a lower bound of the diameter, its diagonal an upper bound.
    if (box.sizes().maxCoeff() > max_hole_m) continue;
    if (box.diagonal().norm() <= max_hole_m || diameter_of(positions) <= max_hole_m)
      holes.push_back(std::move(loops[n]));
  }
  return holes;
}

ScalarField& filled_marks(TriangleMesh& mesh) {
  if (ScalarField* marks = find_field(mesh.face_fields, filled_field)) return *marks;
  mesh.face_fields.push_back(
      {filled_field, ScalarType::uint8, std::vector<double>(mesh.triangles.size(), 0.0)});
  return mesh.face_fields.back();
}

HoleFilling fill_holes(TriangleMesh& mesh, const std::vector<BoundaryLoop>& holes, PatchCheck check,
                       Progress& progress) {
  filled_marks(mesh);
  HoleFilling result;
  if (holes.empty()) return result;
  std::vector<PlacedPatch> patches(holes.size());
  std::vector<bool> is_settled(holes.size(), false);
  const HolePatcher patcher(mesh);
  progress.begin("filling holes", holes.size());
  for (const PatchShape shape : shapes) {
    std::vector<std::size_t> open;
    for (std::size_t n = 0; n < holes.size(); ++n)
      if (!is_settled[n]) open.push_back(n);
    if (open.empty()) break;
    parallel_each(open.size(), [&](std::size_t n) {
      patches[open[n]] = patcher.patch(holes[open[n]], shape);
      if (shape == shapes.front()) progress.advance(1);
    });
    std::vector<bool> is_free(holes.size(), true);
    if (check == PatchCheck::intersection) is_free = free_patches(mesh, holes, patches);
    for (std::size_t n = 0; n < holes.size(); ++n) {
      is_settled[n] = patches[n].found() && is_free[n];
      if (!is_settled[n]) patches[n] = {};
    }
  }
  progress.end();
  const std::size_t first_new = mesh.triangles.size();
  for (std::size_t n = 0; n < holes.size(); ++n) {
    ++(is_settled[n] ? result.holes : result.unfilled);
    if (is_settled[n]) append_patch(mesh, holes[n], patches[n]);
  }
  result.triangles = mesh.triangles.size() - first_new;
  for (std::size_t t = first_new; t < mesh.triangles.size(); ++t)
    result.area_m2 += area_normal(mesh, mesh.triangles[t]).norm() / 2.0;
  return result;
}

}  // namespace libmap
