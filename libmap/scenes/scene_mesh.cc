#include "libmap/scenes/scene_mesh.h"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/scenes/scene_geometry.h"
#include "libmap/scenes/solid.h"

namespace libmap {

namespace {

using std::numbers::pi;

using TriangleSoup = TriangleMesh;  // only vertices and triangles

// Tolerance of points on a surface, m.
constexpr double on_surface_m = 1e-9;

std::uint32_t as_index(std::size_t i) { return static_cast<std::uint32_t>(i); }

// Edge length on a circle of this radius: the sagitta of a chord of length e is e^2 / (8 r).
double step_on(double radius, const SceneMeshOptions& options) {
  return std::min(options.edge_length_m, std::sqrt(8.0 * radius * options.chord_error_m));
}

std::size_t pieces(double length, double step, std::size_t at_least) {
  return std::max(at_least, static_cast<std::size_t>(std::ceil(length / step - 1e-9)));
}

// Maximum radius of a profile, which determines the step of the solid around its axis.
double widest(const Profile& profile) {
  double rho = 0.0;
  for (const ProfileSegment& segment : profile)
    rho = std::max({rho, segment.point(0.0).x(), segment.point(1.0).x(), segment.radius});
  return rho;
}

struct Ring {
  std::uint32_t first = 0;
  std::uint32_t size = 1;  // 1: a pole
};

// Adds the triangles between two adjacent rings, whose sizes may differ.
void stitch(const Ring& upper, const Ring& lower, std::vector<Triangle>& triangles) {
  std::uint32_t i = 0;
  std::uint32_t j = 0;
  const auto at = [](const Ring& ring, std::uint32_t k) { return ring.first + k % ring.size; };
  const std::uint32_t upper_steps = upper.size == 1 ? 0 : upper.size;
  const std::uint32_t lower_steps = lower.size == 1 ? 0 : lower.size;
  while (i < upper_steps || j < lower_steps) {
    const bool step_upper =
        j == lower_steps ||
        (i < upper_steps && std::uint64_t{i + 1} * lower.size <= std::uint64_t{j + 1} * upper.size);
    if (step_upper) {
      triangles.push_back({at(upper, i), at(lower, j), at(upper, i + 1)});
      ++i;
    } else {
      triangles.push_back({at(upper, i), at(lower, j), at(lower, j + 1)});
      ++j;
    }
  }
}

Ring add_ring(const SceneGeometry& geometry, const SceneSolid& solid, std::size_t segment, double t,
              double step, std::vector<Eigen::Vector3d>& vertices) {
  const double rho = solid.profile[segment].point(t).x();
  Ring ring;
  ring.first = as_index(vertices.size());
  if (rho > 1e-9 * widest(solid.profile)) ring.size = as_index(pieces(2.0 * pi * rho, step, 6));
  for (std::uint32_t k = 0; k < ring.size; ++k)
    vertices.push_back(geometry.on_profile(solid, segment, t, 2.0 * pi * k / ring.size).position);
  return ring;
}

double segment_step(const ProfileSegment& segment, double ring_step,
                    const SceneMeshOptions& options) {
  return segment.is_arc ? ring_step : options.edge_length_m;
}

TriangleSoup tessellate_profile(const SceneGeometry& geometry, const SceneSolid& solid,
                                const SceneMeshOptions& options) {
  TriangleSoup soup;
  const double step = step_on(widest(solid.profile), options);
  Ring above = add_ring(geometry, solid, 0, 0.0, step, soup.vertices);
  for (std::size_t s = 0; s < solid.profile.size(); ++s) {
    const ProfileSegment& segment = solid.profile[s];
    // An even number, so that the equator of a sphere is a ring.
    const std::size_t rows =
        2 * pieces(0.5 * segment.length(), segment_step(segment, step, options), 1);
    for (std::size_t row = 1; row <= rows; ++row) {
      const double t = static_cast<double>(row) / static_cast<double>(rows);
      const Ring below = add_ring(geometry, solid, s, t, step, soup.vertices);
      stitch(above, below, soup.triangles);
      above = below;
    }
  }
  return soup;
}

// Adds two triangles per quad of a lattice of columns x rows; at(i, j) returns a vertex.
template <typename At>
void add_quads(std::size_t columns, std::size_t rows, const At& at,
               std::vector<Triangle>& triangles) {
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i) {
      triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
}

double lattice_coordinate(double half, std::size_t i, std::size_t n) {
  return half * (2.0 * static_cast<double>(i) / static_cast<double>(n) - 1.0);
}

TriangleSoup tessellate_plane(const SceneGeometry& geometry, const SceneSolid& solid,
                              const SceneMeshOptions& options) {
  const FlatFace& face = solid.faces.front();
  const std::size_t columns = pieces(2.0 * face.half_x, options.edge_length_m, 1);
  const std::size_t rows = pieces(2.0 * face.half_y, options.edge_length_m, 1);
  TriangleSoup soup;
  for (std::size_t j = 0; j <= rows; ++j)
    for (std::size_t i = 0; i <= columns; ++i)
      soup.vertices.push_back(geometry
                                  .on_face(solid, face, lattice_coordinate(face.half_x, i, columns),
                                           lattice_coordinate(face.half_y, j, rows))
                                  .position);
  const auto at = [&](std::size_t i, std::size_t j) { return as_index(j * (columns + 1) + i); };
  add_quads(columns, rows, at, soup.triangles);
  return soup;
}

// The six faces share the lattice vertices on their common edges.
TriangleSoup tessellate_box(const SceneSolid& solid, const SceneMeshOptions& options) {
  TriangleSoup soup;
  std::array<std::size_t, 3> counts{};
  for (const std::size_t axis : {0U, 1U, 2U})
    counts[axis] =
        pieces(2.0 * solid.half_size[static_cast<Eigen::Index>(axis)], options.edge_length_m, 1);
  std::map<std::array<std::size_t, 3>, std::uint32_t> known;
  const auto vertex_at = [&](const std::array<std::size_t, 3>& lattice_point) {
    const auto [entry, is_new] = known.try_emplace(lattice_point, as_index(soup.vertices.size()));
    if (is_new) {
      Eigen::Vector3d local;
      for (const std::size_t axis : {0U, 1U, 2U})
        local[static_cast<Eigen::Index>(axis)] = lattice_coordinate(
            solid.half_size[static_cast<Eigen::Index>(axis)], lattice_point[axis], counts[axis]);
      soup.vertices.push_back(solid.scene_from_solid * local);
    }
    return entry->second;
  };
  for (const std::size_t axis : {0U, 1U, 2U}) {
    for (const bool upper : {false, true}) {
      // The order of the other two axes determines that the face is oriented outward.
      const std::size_t u = (axis + (upper ? 1 : 2)) % 3;
      const std::size_t v = (axis + (upper ? 2 : 1)) % 3;
      const auto at = [&](std::size_t i, std::size_t j) {
        std::array<std::size_t, 3> lattice_point{};
        lattice_point[axis] = upper ? counts[axis] : 0;
        lattice_point[u] = i;
        lattice_point[v] = j;
        return vertex_at(lattice_point);
      };
      add_quads(counts[u], counts[v], at, soup.triangles);
    }
  }
  return soup;
}

Eigen::Vector3d gradient_of(const SceneGeometry& geometry, const SceneSolid& solid,
                            const Eigen::Vector3d& point) {
  constexpr double h = 1e-6;
  Eigen::Vector3d gradient;
  for (const int axis : {0, 1, 2}) {
    const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(axis);
    gradient[axis] = (geometry.signed_distance(solid, point + step) -
                      geometry.signed_distance(solid, point - step)) /
                     (2.0 * h);
  }
  return gradient;
}

// Nearest point on both surfaces, by Newton's method with minimum-norm steps. Returns `start` if it
// does not converge within `reach`, for example if the surfaces only touch.
Eigen::Vector3d onto_both(const SceneGeometry& geometry, const SceneSolid& a, const SceneSolid& b,
                          const Eigen::Vector3d& start, double reach) {
  Eigen::Vector3d point = start;
  for (int step = 0; step < 20; ++step) {
    const Eigen::Vector2d value(geometry.signed_distance(a, point),
                                geometry.signed_distance(b, point));
    if (value.cwiseAbs().maxCoeff() < 1e-14) return point;
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian.row(0) = gradient_of(geometry, a, point).transpose();
    jacobian.row(1) = gradient_of(geometry, b, point).transpose();
    const Eigen::Matrix2d normal = jacobian * jacobian.transpose();
    if (std::abs(normal.determinant()) < 1e-6) return start;
    point -= jacobian.transpose() * normal.inverse() * value;
    if (!((point - start).norm() <= reach)) return start;
  }
  const bool converged = std::abs(geometry.signed_distance(a, point)) < 1e-11 &&
                         std::abs(geometry.signed_distance(b, point)) < 1e-11;
  return converged ? point : start;
}

// Intersection of an edge with the surface of `other`, by bisection.
Eigen::Vector3d crossing(const SceneGeometry& geometry, const SceneSolid& other,
                         Eigen::Vector3d outside, Eigen::Vector3d inside) {
  for (int step = 0; step < 60; ++step) {
    const Eigen::Vector3d middle = 0.5 * (outside + inside);
    (geometry.signed_distance(other, middle) > 0.0 ? outside : inside) = middle;
  }
  return 0.5 * (outside + inside);
}

// Cuts the surface of `solid` along `other` and drops its hidden part. New vertices are on both
// surfaces; adjacent triangles share the vertex on their common edge.
class Cutter {
 public:
  Cutter(const SceneGeometry& geometry, const TriangleSoup& soup, const SceneSolid& solid,
         const SceneSolid& other)
      : geometry_(geometry), soup_(soup), solid_(solid), other_(other) {}

  TriangleSoup cut() {
    result_.vertices = soup_.vertices;
    distances_.reserve(soup_.vertices.size());
    for (const Eigen::Vector3d& vertex : soup_.vertices)
      distances_.push_back(geometry_.signed_distance(other_, vertex));
    for (const Triangle& triangle : soup_.triangles) cut_triangle(triangle);
    return std::move(result_);
  }

 private:
  int side_of(std::uint32_t vertex) const {
    const double distance = distances_[vertex];
    return distance > on_surface_m ? 1 : (distance < -on_surface_m ? -1 : 0);
  }

  void cut_triangle(const Triangle& triangle) {
    int outside = 0;
    int inside = 0;
    for (const std::uint32_t vertex : triangle) {
      outside += side_of(vertex) > 0 ? 1 : 0;
      inside += side_of(vertex) < 0 ? 1 : 0;
    }
    if (outside == 0 && (inside > 0 || is_hidden(triangle))) return;
    if (inside == 0) {
      result_.triangles.push_back(triangle);
      return;
    }
    std::vector<std::uint32_t> polygon;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = triangle[k];
      const std::uint32_t to = triangle[(k + 1) % 3];
      if (side_of(from) >= 0) polygon.push_back(from);
      if (side_of(from) * side_of(to) < 0) polygon.push_back(cut_vertex(from, to));
    }
    for (std::size_t k = 2; k < polygon.size(); ++k)
      result_.triangles.push_back({polygon[0], polygon[k - 1], polygon[k]});
  }

  // Visibility of a triangle on the surface of the other solid.
  bool is_hidden(const Triangle& triangle) const {
    const Eigen::Vector3d& a = soup_.vertices[triangle[0]];
    const Eigen::Vector3d& b = soup_.vertices[triangle[1]];
    const Eigen::Vector3d& c = soup_.vertices[triangle[2]];
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    // The center of a triangle is inside a round solid: projects it onto the surface.
    Eigen::Vector3d center = (a + b + c) / 3.0;
    for (int step = 0; step < 3; ++step)
      center -= geometry_.signed_distance(solid_, center) * normal;
    return geometry_.is_hidden_by(solid_, other_, center, normal);
  }

  std::uint32_t cut_vertex(std::uint32_t from, std::uint32_t to) {
    const auto key = std::minmax(from, to);
    const auto [entry, is_new] = cuts_.try_emplace({key.first, key.second}, 0);
    if (is_new) {
      const bool from_outside = side_of(from) > 0;
      const Eigen::Vector3d& outside = soup_.vertices[from_outside ? from : to];
      const Eigen::Vector3d& inside = soup_.vertices[from_outside ? to : from];
      entry->second = as_index(result_.vertices.size());
      const Eigen::Vector3d start = crossing(geometry_, other_, outside, inside);
      result_.vertices.push_back(
          onto_both(geometry_, solid_, other_, start, 0.5 * (outside - inside).norm()));
    }
    return entry->second;
  }

  const SceneGeometry& geometry_;
  const TriangleSoup& soup_;
  const SceneSolid& solid_;
  const SceneSolid& other_;
  TriangleSoup result_;
  std::vector<double> distances_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> cuts_;
};

// Complete surface of a solid, closed except for a plane.
TriangleSoup tessellate(const SceneGeometry& geometry, const SceneSolid& solid,
                        const SceneMeshOptions& options) {
  if (!solid.profile.empty()) return tessellate_profile(geometry, solid, options);
  return solid.is_plane ? tessellate_plane(geometry, solid, options)
                        : tessellate_box(solid, options);
}

// Estimated number of triangles of tessellate().
double estimated_triangles(const SceneSolid& solid, const SceneMeshOptions& options) {
  double triangles = 0.0;
  if (!solid.profile.empty()) {
    const double step = step_on(widest(solid.profile), options);
    for (const ProfileSegment& segment : solid.profile)
      triangles += 2.0 * segment.area() / step / segment_step(segment, step, options);
  }
  for (const FlatFace& face : solid.faces)
    triangles += 8.0 * face.half_x * face.half_y / options.edge_length_m / options.edge_length_m;
  return triangles;
}

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

// Border edges: edges with one triangle.
std::vector<Edge> open_edges(const std::vector<Triangle>& triangles) {
  std::map<Edge, int> uses;
  for (const Triangle& triangle : triangles)
    for (std::size_t k = 0; k < 3; ++k) ++uses[std::minmax(triangle[k], triangle[(k + 1) % 3])];
  std::vector<Edge> open;
  for (const auto& [edge, count] : uses)
    if (count == 1) open.push_back(edge);
  return open;
}

// Visible part of a solid, without unused vertices.
TriangleSoup visible_part(const SceneGeometry& geometry, const SceneSolid& solid,
                          const SceneMeshOptions& options) {
  TriangleSoup soup = tessellate(geometry, solid, options);
  for (const SceneSolid& other : geometry.solids()) {
    if (&other == &solid) continue;
    if ((solid.bound_center - other.bound_center).norm() >
        solid.bound_radius + other.bound_radius + 1e-6)
      continue;
    soup = Cutter(geometry, soup, solid, other).cut();
  }
  drop_unused_vertices(soup.vertices, soup.triangles);
  return soup;
}

// Triangulates the ground, constrained by the edges at which other solids meet it.
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

  // Appends the visible ground to the mesh and the shape of each triangle to `shapes`.
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

  // Returns true for points on the top of the ground, not on the sides below its outline.
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

  // Inserts a grid without points that are hidden or close to a footprint.
  void insert_grid() {
    const std::size_t columns = pieces(2.0 * face_.half_x, options_.edge_length_m, 1);
    const std::size_t rows = pieces(2.0 * face_.half_y, options_.edge_length_m, 1);
    std::vector<Triangulation::Point> points;
    for (std::size_t j = 0; j <= rows; ++j) {
      for (std::size_t i = 0; i <= columns; ++i) {
        const double x = lattice_coordinate(face_.half_x, i, columns);
        const double y = lattice_coordinate(face_.half_y, j, rows);
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

}  // namespace

TriangleMesh scene_mesh(const PrimitiveScene& scene, const SceneMeshOptions& options) {
  const SceneGeometry geometry(scene);
  double triangles = 0.0;
  for (const SceneSolid& solid : geometry.solids())
    triangles += estimated_triangles(solid, options);
  require_count(triangles, options.max_triangles, "triangles", "edge_length_m",
                to_text(options.edge_length_m));
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
