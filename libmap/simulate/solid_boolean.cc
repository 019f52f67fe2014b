#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/Euler_operations.h>

#include <algorithm>
#include <array>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/simulate/solid.h"

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
    if (face == Mesh::null_face()) throw Error("a solid's surface is no manifold");
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
  return in_order(solid);
}

// Hands the labels of faces on to their parts and copies.
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
    throw Error("the union of two solids is no manifold: they touch along an edge or in a point");
}

// Whether no triangle about the edge turns by more than 30 degrees, and none about its ends
// vanishes, when its source moves onto its target.
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
  // In an order, and each in a direction, that follows from the places of its ends.
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
      const auto place = mesh.point(mesh.target(half));
      mesh.point(CGAL::Euler::collapse_edge(edge, mesh)) = place;
      break;
    }
  }
}

bool overlap(const Bounds3d& a, const Bounds3d& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

}  // namespace

// CGAL goes through its two operands in the order of their addresses: the meshes lie in one array,
// so that the result does not depend on where memory happens to be.
Solid unite(const std::vector<Solid>& solids, double min_edge_m) {
  if (solids.empty()) return {};
  // All but the first are gathered into meshes of parts that do not meet, the fewer the better.
  std::vector<Mesh> meshes;
  meshes.reserve(solids.size());
  append(meshes.emplace_back(), solids.front());
  std::vector<std::vector<Bounds3d>> boxes(1);
  for (std::size_t n = 1; n < solids.size(); ++n) {
    const Bounds3d box = bounds_of(solids[n].vertices);
    const auto place = std::find_if(boxes.begin() + 1, boxes.end(), [&](const auto& others) {
      return std::none_of(others.begin(), others.end(),
                          [&](const Bounds3d& other) { return overlap(other, box); });
    });
    const auto index = static_cast<std::size_t>(place - boxes.begin());
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
    throw Error("the difference of two solids is no manifold");
  return to_solid(meshes[0]);
}

}  // namespace libmap
