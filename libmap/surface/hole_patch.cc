#include "libmap/surface/hole_patch.h"

#define CGAL_EIGEN3_ENABLED
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>

#include <exception>
#include <iterator>

namespace libmap {

namespace {

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

// Larger holes are triangulated over their Delaunay triangulation alone: the search over all
// triangulations takes the cube of the number of edges.
constexpr std::size_t max_cubic_edges = 150;

// Whether all of it could be entered.
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

}  // namespace

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
    // CGAL reports geometry that it cannot take by exceptions of several kinds.
    return {};
  }
}

}  // namespace libmap
