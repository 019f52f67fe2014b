#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/boost/graph/Euler_operations.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/scenes/solid.h"

namespace libmap {

namespace {

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Face = Mesh::Face_index;
using Labels = Mesh::Property_map<Face, int>;

Labels labels_of(Mesh& mesh) { return mesh.add_property_map<Face, int>("f:label", 0).first; }

void append(Mesh& mesh, const Solid& solid) {
  Labels labels = labels_of(mesh);
  const auto first = static_cast<std::uint32_t>(mesh.number_of_vertices());
  for (const Eigen::Vector3d& vertex : solid.vertices)
    mesh.add_vertex({vertex.x(), vertex.y(), vertex.z()});
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    const Triangle& triangle = solid.triangles[n];
    const Face face = mesh.add_face(Mesh::Vertex_index(first + triangle[0]),
                                    Mesh::Vertex_index(first + triangle[1]),
                                    Mesh::Vertex_index(first + triangle[2]));
    if (face == Mesh::null_face()) throw Error("the surface of a solid is not a manifold");
    labels[face] = solid.labels[n];
  }
}

Solid to_solid(Mesh& mesh) {
  mesh.collect_garbage();
  const Labels labels = labels_of(mesh);
  Solid solid;
  solid.vertices.reserve(mesh.number_of_vertices());
  for (const auto vertex : mesh.vertices()) {
    const auto& point = mesh.point(vertex);
    solid.vertices.emplace_back(point.x(), point.y(), point.z());
  }
  solid.triangles.reserve(mesh.number_of_faces());
  for (const Face face : mesh.faces()) {
    Triangle triangle{};
    std::size_t k = 0;
    for (const auto vertex : mesh.vertices_around_face(mesh.halfedge(face)))
      triangle[k++] = static_cast<std::uint32_t>(vertex);
    solid.triangles.push_back(triangle);
    solid.labels.push_back(labels[face]);
  }
  return sort_solid(solid);
}

// Copies the labels of faces to their parts and copies.
class LabelKeeper : public processing::Corefinement::Default_visitor<Mesh> {
 public:
  void before_subface_creations(Face split, Mesh& mesh) { label_ = labels_of(mesh)[split]; }
  void after_subface_created(Face part, Mesh& mesh) { labels_of(mesh)[part] = label_; }
  void after_face_copy(Face from, const Mesh& source, Face to, Mesh& target) {
    labels_of(target)[to] = source.property_map<Face, int>("f:label").first[from];
  }

 private:
  int label_ = 0;
};

void unite_into(Mesh& mesh, Mesh& other) {
  if (!processing::corefine_and_compute_union(mesh, other, mesh,
                                              processing::parameters::visitor(LabelKeeper()),
                                              processing::parameters::default_values()))
    throw Error("not a manifold: the two solids touch at an edge or a point", {.field = "union"});
}

// Returns true if moving the edge's source onto its target rotates no adjacent triangle by more
// than 30 degrees and degenerates none.
bool may_collapse(const Mesh& mesh, Mesh::Halfedge_index edge) {
  const auto moved = mesh.source(edge);
  const auto& target = mesh.point(mesh.target(edge));
  for (const auto around : mesh.halfedges_around_target(mesh.opposite(edge))) {
    const Face face = mesh.face(around);
    if (face == mesh.face(edge) || face == mesh.face(mesh.opposite(edge))) continue;
    const auto& a = mesh.point(moved);
    const auto& b = mesh.point(mesh.target(mesh.next(around)));
    const auto& c = mesh.point(mesh.source(around));
    const auto before = CGAL::cross_product(b - a, c - a);
    const auto after = CGAL::cross_product(b - target, c - target);
    const double product = before * after;
    if (product <= 0.0 ||
        product * product < 0.75 * before.squared_length() * after.squared_length())
      return false;
  }
  return true;
}

void collapse_short_edges(Mesh& mesh, double min_edge_m) {
  const auto is_short = [&](Mesh::Halfedge_index edge) {
    return CGAL::squared_distance(mesh.point(mesh.source(edge)), mesh.point(mesh.target(edge))) <
           min_edge_m * min_edge_m;
  };
  // Order and direction of the edges depend only on the positions of their ends.
  std::vector<Mesh::Halfedge_index> edges;
  const auto ends = [&](Mesh::Halfedge_index edge) {
    return std::pair(mesh.point(mesh.source(edge)), mesh.point(mesh.target(edge)));
  };
  for (const auto edge : mesh.halfedges())
    if (is_short(edge) && ends(edge).first < ends(edge).second) edges.push_back(edge);
  std::sort(edges.begin(), edges.end(), [&](auto a, auto b) { return ends(a) < ends(b); });
  for (const auto first : edges) {
    if (mesh.is_removed(first)) continue;
    const auto edge = mesh.edge(first);
    for (const auto half : {first, mesh.opposite(first)}) {
      if (!is_short(half) || !may_collapse(mesh, half) ||
          !CGAL::Euler::does_satisfy_link_condition(edge, mesh))
        continue;
      const auto position = mesh.point(mesh.target(half));
      mesh.point(CGAL::Euler::collapse_edge(edge, mesh)) = position;
      break;
    }
  }
}

bool overlap(const Bounds3d& a, const Bounds3d& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

}  // namespace

// CGAL processes its two operands in the order of their addresses. The meshes are in one array, so
// that the result does not depend on memory allocation.
Solid unite(const std::vector<Solid>& solids, double min_edge_m) {
  if (solids.empty()) return {};
  // All solids except the first are grouped into few meshes of disjoint parts.
  std::vector<Mesh> meshes;
  meshes.reserve(solids.size());
  append(meshes.emplace_back(), solids.front());
  std::vector<std::vector<Bounds3d>> boxes(1);
  for (std::size_t n = 1; n < solids.size(); ++n) {
    const Bounds3d box = bounds_of(solids[n].vertices);
    const auto overlapping = std::find_if(boxes.begin() + 1, boxes.end(), [&](const auto& others) {
      return std::none_of(others.begin(), others.end(),
                          [&](const Bounds3d& other) { return overlap(other, box); });
    });
    const auto index = static_cast<std::size_t>(overlapping - boxes.begin());
    if (index == meshes.size()) {
      meshes.emplace_back();
      boxes.emplace_back();
    }
    append(meshes[index], solids[n]);
    boxes[index].push_back(box);
  }
  for (std::size_t n = 2; n < meshes.size(); ++n) unite_into(meshes[1], meshes[n]);
  if (meshes.size() > 1) unite_into(meshes[0], meshes[1]);
  if (min_edge_m > 0.0) collapse_short_edges(meshes[0], min_edge_m);
  return to_solid(meshes[0]);
}

Solid subtract(const Solid& solid, const Solid& removed) {
  std::array<Mesh, 2> meshes;
  append(meshes[0], solid);
  append(meshes[1], removed);
  if (!processing::corefine_and_compute_difference(meshes[0], meshes[1], meshes[0],
                                                   processing::parameters::visitor(LabelKeeper()),
                                                   processing::parameters::default_values()))
    throw Error("not a manifold", {.field = "difference of two solids"});
  return to_solid(meshes[0]);
}

namespace {

constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();
struct VertexInfo {
  std::uint32_t vertex = no_vertex;
};
struct FaceInfo {
  int depth = -1;  // number of outlines between the face and the outside
};
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<VertexInfo, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceInfo, Kernel,
                                              CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Structure = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
using Triangulation =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, Structure, CGAL::Exact_predicates_tag>;

using Edge = std::pair<std::uint32_t, std::uint32_t>;

struct Region {
  std::vector<std::size_t> triangles;
  std::vector<Edge> outline;  // the region is on the left
};

// Triangles and outline of each label.
std::map<int, Region> regions_of(const Solid& solid) {
  std::map<Edge, int> label_of;
  for (std::size_t n = 0; n < solid.triangles.size(); ++n)
    for (std::size_t k = 0; k < 3; ++k)
      label_of[{solid.triangles[n][k], solid.triangles[n][(k + 1) % 3]}] = solid.labels[n];
  std::map<int, Region> regions;
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    Region& region = regions[solid.labels[n]];
    region.triangles.push_back(n);
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge edge{solid.triangles[n][k], solid.triangles[n][(k + 1) % 3]};
      const auto across = label_of.find({edge.second, edge.first});
      if (across == label_of.end() || across->second != solid.labels[n])
        region.outline.push_back(edge);
    }
  }
  return regions;
}

class FacetRefiner {
 public:
  FacetRefiner(const Solid& solid, double edge_length_m)
      : solid_(solid), edge_length_m_(edge_length_m) {}

  Solid refine() {
    for (const auto& [label, region] : regions_of(solid_)) refine_region(region, label);
    return sort_solid(result_);
  }

 private:
  struct Segment {
    Eigen::Vector2d from;
    Eigen::Vector2d to;
  };

  std::uint32_t corner(std::uint32_t vertex) {
    const auto [entry, is_new] =
        corners_.emplace(vertex, static_cast<std::uint32_t>(result_.vertices.size()));
    if (is_new) result_.vertices.push_back(solid_.vertices[vertex]);
    return entry->second;
  }

  // Points of an edge in order, shared by both of its regions.
  const std::vector<std::uint32_t>& chain(const Edge& edge) {
    const Edge key = std::minmax(edge.first, edge.second);
    auto found = chains_.find(key);
    if (found == chains_.end()) {
      const Eigen::Vector3d from = solid_.vertices[key.first];
      const Eigen::Vector3d to = solid_.vertices[key.second];
      const int steps =
          std::max(1, static_cast<int>(std::lround((to - from).norm() / edge_length_m_)));
      std::vector<std::uint32_t> points = {corner(key.first)};
      for (int n = 1; n < steps; ++n) {
        points.push_back(static_cast<std::uint32_t>(result_.vertices.size()));
        result_.vertices.push_back(from + (static_cast<double>(n) / steps) * (to - from));
      }
      points.push_back(corner(key.second));
      found = chains_.emplace(key, std::move(points)).first;
    }
    return found->second;
  }

  void refine_region(const Region& region, int label) {
    set_plane(region);
    Triangulation triangulation;
    outline_.clear();
    for (const Edge& edge : region.outline) {
      outline_.push_back(
          {in_plane(solid_.vertices[edge.first]), in_plane(solid_.vertices[edge.second])});
      const std::vector<std::uint32_t>& points = chain(edge);
      for (std::size_t n = 1; n < points.size(); ++n) {
        const auto from = insert(triangulation, points[n - 1]);
        const auto to = insert(triangulation, points[n]);
        if (from != to) triangulation.insert_constraint(from, to);
      }
    }
    insert_inner_points(triangulation);
    keep_inside(triangulation, label);
  }

  void set_plane(const Region& region) {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (const std::size_t n : region.triangles) {
      const Triangle& triangle = solid_.triangles[n];
      const Eigen::Vector3d& a = solid_.vertices[triangle[0]];
      normal += (solid_.vertices[triangle[1]] - a).cross(solid_.vertices[triangle[2]] - a);
    }
    normal.normalize();
    origin_ = solid_.vertices[solid_.triangles[region.triangles.front()][0]];
    axis_u_ = normal.unitOrthogonal();
    axis_v_ = normal.cross(axis_u_);
  }

  Eigen::Vector2d in_plane(const Eigen::Vector3d& point) const {
    return {axis_u_.dot(point - origin_), axis_v_.dot(point - origin_)};
  }

  Triangulation::Vertex_handle insert(Triangulation& triangulation, std::uint32_t vertex) const {
    const Eigen::Vector2d at = in_plane(result_.vertices[vertex]);
    const auto handle = triangulation.insert({at.x(), at.y()});
    if (handle->info().vertex != no_vertex && handle->info().vertex != vertex)
      throw Error("two of a facet coincide", {.field = "corners"});
    handle->info().vertex = vertex;
    return handle;
  }

  // Inserts a grid of equilateral triangles, except close to the outline.
  void insert_inner_points(Triangulation& triangulation) const {
    Eigen::AlignedBox2d box;
    for (const Segment& segment : outline_) box.extend(segment.from);
    const double row_height = edge_length_m_ * std::sqrt(0.75);
    const auto rows = static_cast<int>(box.sizes().y() / row_height);
    const auto columns = static_cast<int>(box.sizes().x() / edge_length_m_);
    std::vector<Triangulation::Point> points;
    for (int j = 0; j <= rows; ++j) {
      for (int i = 0; i <= columns; ++i) {
        const double shift = j % 2 == 0 ? 0.25 : 0.75;
        const Eigen::Vector2d at =
            box.min() + Eigen::Vector2d((i + shift) * edge_length_m_, (j + 0.5) * row_height);
        if (is_inside(at) && is_clear(at)) points.emplace_back(at.x(), at.y());
      }
    }
    triangulation.insert(points.begin(), points.end());
  }

  bool is_inside(const Eigen::Vector2d& at) const {
    bool inside = false;
    for (const Segment& s : outline_) {
      if ((s.from.y() > at.y()) == (s.to.y() > at.y())) continue;
      const double fraction = (at.y() - s.from.y()) / (s.to.y() - s.from.y());
      if (at.x() < s.from.x() + fraction * (s.to.x() - s.from.x())) inside = !inside;
    }
    return inside;
  }

  bool is_clear(const Eigen::Vector2d& at) const {
    const double margin = 0.6 * edge_length_m_;
    return std::none_of(outline_.begin(), outline_.end(), [&](const Segment& s) {
      const Eigen::Vector2d along = s.to - s.from;
      const double fraction =
          std::clamp((at - s.from).dot(along) / std::max(along.squaredNorm(), 1e-30), 0.0, 1.0);
      return (s.from + fraction * along - at).squaredNorm() < margin * margin;
    });
  }

  // Sets the depth of all faces. Faces of odd depth are inside.
  static void mark_depths(Triangulation& triangulation) {
    std::vector<std::pair<Triangulation::Face_handle, int>> open = {
        {triangulation.infinite_face(), 0}};
    // Faces are visited in ascending order of depth.
    for (std::size_t depth = 0; !open.empty(); ++depth) {
      std::vector<std::pair<Triangulation::Face_handle, int>> deeper;
      while (!open.empty()) {
        const auto [face, level] = open.back();
        open.pop_back();
        if (face->info().depth >= 0) continue;
        face->info().depth = level;
        for (int k = 0; k < 3; ++k) {
          const auto neighbor = face->neighbor(k);
          if (neighbor->info().depth >= 0) continue;
          if (triangulation.is_constrained({face, k}))
            deeper.emplace_back(neighbor, level + 1);
          else
            open.emplace_back(neighbor, level);
        }
      }
      open = std::move(deeper);
    }
  }

  void keep_inside(Triangulation& triangulation, int label) {
    mark_depths(triangulation);
    for (auto face = triangulation.finite_faces_begin(); face != triangulation.finite_faces_end();
         ++face) {
      if (face->info().depth % 2 == 0) continue;
      Triangle triangle{};
      for (int k = 0; k < 3; ++k) {
        const auto handle = face->vertex(k);
        if (handle->info().vertex == no_vertex) {
          handle->info().vertex = static_cast<std::uint32_t>(result_.vertices.size());
          result_.vertices.push_back(origin_ + handle->point().x() * axis_u_ +
                                     handle->point().y() * axis_v_);
        }
        triangle[static_cast<std::size_t>(k)] = handle->info().vertex;
      }
      result_.triangles.push_back(triangle);
      result_.labels.push_back(label);
    }
  }

  const Solid& solid_;
  const double edge_length_m_;
  Solid result_;
  std::map<std::uint32_t, std::uint32_t> corners_;
  std::map<Edge, std::vector<std::uint32_t>> chains_;
  // State of the current region.
  Eigen::Vector3d origin_;
  Eigen::Vector3d axis_u_;
  Eigen::Vector3d axis_v_;
  std::vector<Segment> outline_;
};

}  // namespace

Solid refine_facets(const Solid& solid, double edge_length_m) {
  return FacetRefiner(solid, edge_length_m).refine();
}

}  // namespace libmap
