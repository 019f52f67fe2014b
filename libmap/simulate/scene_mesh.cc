#include "libmap/simulate/scene_mesh.h"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/simulate/scene_geometry.h"
#include "libmap/simulate/scene_tessellation.h"
#include "libmap/simulate/solid.h"

namespace libmap {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();
struct VertexInfo {
  std::uint32_t vertex = no_vertex;
};
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<VertexInfo, Kernel>;
using FaceBase = CGAL::Constrained_triangulation_face_base_2<Kernel>;
using Structure = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
// Cut edges of overlapping solids may cross.
using Triangulation =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, Structure, CGAL::Exact_predicates_tag>;

using Edge = std::pair<std::uint32_t, std::uint32_t>;

// Edges with one triangle only.
std::vector<Edge> open_edges(const std::vector<Triangle>& triangles) {
  std::map<Edge, int> uses;
  for (const Triangle& triangle : triangles)
    for (std::size_t k = 0; k < 3; ++k) ++uses[std::minmax(triangle[k], triangle[(k + 1) % 3])];
  std::vector<Edge> open;
  for (const auto& [edge, count] : uses)
    if (count == 1) open.push_back(edge);
  return open;
}

// What of one solid is seen, without unused vertices.
TriangleSoup visible_part(const SceneGeometry& geometry, const SceneSolid& solid,
                          const SceneMeshOptions& options) {
  TriangleSoup soup = tessellate(geometry, solid, options);
  for (const SceneSolid& other : geometry.solids()) {
    if (&other == &solid) continue;
    if ((solid.bound_center - other.bound_center).norm() >
        solid.bound_radius + other.bound_radius + 1e-6)
      continue;
    soup = cut_by(geometry, soup, solid, other);
  }
  drop_unused_vertices(soup.vertices, soup.triangles);
  return soup;
}

// The ground, triangulated around the edges at which the other solids' meshes meet it.
class GroundMesher {
 public:
  GroundMesher(const SceneGeometry& geometry, const SceneMeshOptions& options, TriangleMesh& mesh)
      : geometry_(geometry),
        ground_(*geometry.ground()),
        face_(geometry.ground()->faces.front()),
        options_(options),
        mesh_(mesh) {}

  void add_footprint(const std::vector<Triangle>& triangles) {
    for (const auto& [a, b] : open_edges(triangles)) {
      if (!is_on_ground(mesh_.vertices[a]) || !is_on_ground(mesh_.vertices[b])) continue;
      const auto from = insert_vertex(a);
      const auto to = insert_vertex(b);
      if (from != to) triangulation_.insert_constraint(from, to);
    }
  }

  // Appends the visible ground to the mesh; `shapes` gets the shape of each triangle.
  void finish(std::vector<double>& shapes) {
    insert_grid();
    for (auto face = triangulation_.finite_faces_begin(); face != triangulation_.finite_faces_end();
         ++face) {
      const Eigen::Vector2d center =
          (in_plane(face->vertex(0)) + in_plane(face->vertex(1)) + in_plane(face->vertex(2))) / 3.0;
      const SurfaceTruth truth = geometry_.on_face(ground_, face_, center.x(), center.y());
      if (!geometry_.is_visible(ground_, truth.position, truth.normal)) continue;
      mesh_.triangles.push_back(
          {index_of(face->vertex(0)), index_of(face->vertex(1)), index_of(face->vertex(2))});
      shapes.push_back(truth.shape);
    }
  }

 private:
  using Handle = Triangulation::Vertex_handle;

  // On the top of the ground, and not on a side beneath its outline.
  bool is_on_ground(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d local = ground_.solid_from_scene * point;
    if (std::abs(local.x()) > face_.half_x || std::abs(local.y()) > face_.half_y) return false;
    const double height = geometry_.ground_height(local.x(), local.y()).value;
    return std::abs(local.z() - height) <= on_surface_m;
  }

  Handle insert_vertex(std::uint32_t vertex) {
    const Eigen::Vector3d local = ground_.solid_from_scene * mesh_.vertices[vertex];
    const Handle handle = triangulation_.insert({local.x(), local.y()});
    if (handle->info().vertex == no_vertex) handle->info().vertex = vertex;
    return handle;
  }

  // A grid, without the points that are hidden or crowd a footprint.
  void insert_grid() {
    const auto columns =
        static_cast<std::size_t>(std::ceil(2.0 * face_.half_x / options_.edge_length_m - 1e-9));
    const auto rows =
        static_cast<std::size_t>(std::ceil(2.0 * face_.half_y / options_.edge_length_m - 1e-9));
    std::vector<Triangulation::Point> points;
    for (std::size_t j = 0; j <= rows; ++j) {
      for (std::size_t i = 0; i <= columns; ++i) {
        const double x =
            face_.half_x * (2.0 * static_cast<double>(i) / static_cast<double>(columns) - 1.0);
        const double y =
            face_.half_y * (2.0 * static_cast<double>(j) / static_cast<double>(rows) - 1.0);
        const bool on_border = i == 0 || j == 0 || i == columns || j == rows;
        if (on_border || is_clear(x, y)) points.emplace_back(x, y);
      }
    }
    triangulation_.insert(points.begin(), points.end());
  }

  bool is_clear(double x, double y) const {
    const double margin = 0.3 * options_.edge_length_m;
    const Eigen::Vector3d point = geometry_.on_face(ground_, face_, x, y).position;
    return std::none_of(
        geometry_.solids().begin(), geometry_.solids().end(), [&](const SceneSolid& other) {
          return &other != &ground_ &&
                 (point - other.bound_center).norm() < other.bound_radius + margin &&
                 geometry_.signed_distance(other, point) < margin;
        });
  }

  static Eigen::Vector2d in_plane(const Handle& vertex) {
    return {vertex->point().x(), vertex->point().y()};
  }

  std::uint32_t index_of(const Handle& vertex) {
    if (vertex->info().vertex == no_vertex) {
      vertex->info().vertex = static_cast<std::uint32_t>(mesh_.vertices.size());
      const Eigen::Vector2d at = in_plane(vertex);
      mesh_.vertices.push_back(geometry_.on_face(ground_, face_, at.x(), at.y()).position);
    }
    return vertex->info().vertex;
  }

  const SceneGeometry& geometry_;
  const SceneSolid& ground_;
  const FlatFace& face_;
  const SceneMeshOptions& options_;
  TriangleMesh& mesh_;
  Triangulation triangulation_;
};

void check(const SceneGeometry& geometry, const SceneMeshOptions& options) {
  double triangles = 0.0;
  for (const SceneSolid& solid : geometry.solids())
    triangles += estimated_triangles(solid, options);
  require_count(triangles, options.max_triangles, "triangles", "edge_length_m",
                to_text(options.edge_length_m));
}

}  // namespace

TriangleMesh scene_mesh(const PrimitiveScene& scene, const SceneMeshOptions& options) {
  const SceneGeometry geometry(scene);
  check(geometry, options);
  TriangleMesh mesh;
  std::vector<double> shapes;
  std::optional<GroundMesher> ground;
  if (geometry.ground() != nullptr) ground.emplace(geometry, options, mesh);
  for (const SceneSolid& solid : geometry.solids()) {
    if (solid.is_ground) continue;
    TriangleSoup part = visible_part(geometry, solid, options);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (Triangle& triangle : part.triangles)
      for (std::uint32_t& vertex : triangle) vertex += first;
    mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
    mesh.triangles.insert(mesh.triangles.end(), part.triangles.begin(), part.triangles.end());
    shapes.resize(mesh.triangles.size(), solid.shape);
    if (ground) ground->add_footprint(part.triangles);
  }
  if (ground) ground->finish(shapes);
  mesh.face_fields.push_back({"shape", ScalarType::int32, std::move(shapes)});
  return mesh;
}

}  // namespace libmap
