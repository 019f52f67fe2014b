#include "libmap/core/triangle_mesh.h"

#include <Eigen/Geometry>
#include <limits>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

void require_length(const std::string& what, std::size_t length, std::size_t wanted) {
  if (length == wanted) return;
  throw Error("does not match the mesh, which needs " + std::to_string(wanted) + " values",
              {.field = what, .value = std::to_string(length) + " values long"});
}

}  // namespace

void TriangleMesh::check() const {
  if (!vertex_normals.empty())
    require_length("vertex normals", vertex_normals.size(), vertices.size());
  if (!vertex_colors.empty())
    require_length("vertex colors", vertex_colors.size(), vertices.size());
  for (const ScalarField& field : vertex_fields)
    require_length(field.name, field.values.size(), vertices.size());
  for (const ScalarField& field : face_fields)
    require_length(field.name, field.values.size(), triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (const std::uint32_t index : triangles[i])
      if (index >= vertices.size())
        throw Error("does not exist", {.field = "vertex of triangle " + std::to_string(i),
                                       .value = std::to_string(index),
                                       .bound = "< " + std::to_string(vertices.size())});
}

void append_mesh(const TriangleMesh& more, TriangleMesh& mesh) {
  if (more.vertices.empty()) return;
  if (mesh.vertices.empty()) {
    mesh = more;
    return;
  }
  const std::size_t first = mesh.vertices.size();
  if (first + more.vertices.size() > std::numeric_limits<std::uint32_t>::max())
    throw Error("too many vertices for one mesh");
  append_values(more.vertices, mesh.vertices);
  append_values(more.vertex_normals, mesh.vertex_normals);
  append_values(more.vertex_colors, mesh.vertex_colors);
  append_fields(more.vertex_fields, mesh.vertex_fields);
  append_fields(more.face_fields, mesh.face_fields);
  for (Triangle triangle : more.triangles) {
    for (std::uint32_t& v : triangle) v += static_cast<std::uint32_t>(first);
    mesh.triangles.push_back(triangle);
  }
}

Eigen::Vector3d area_normal(const TriangleMesh& mesh, const Triangle& triangle) {
  const Eigen::Vector3d& origin = mesh.vertices[triangle[0]];
  return (mesh.vertices[triangle[1]] - origin).cross(mesh.vertices[triangle[2]] - origin);
}

double surface_area(const TriangleMesh& mesh) {
  double twice = 0.0;
  for (const Triangle& triangle : mesh.triangles) twice += area_normal(mesh, triangle).norm();
  return twice / 2.0;
}

double signed_volume(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return 0.0;
  // Relative to a vertex, because a distant origin would cost precision.
  const Eigen::Vector3d origin = mesh.vertices.front();
  double sixfold = 0.0;
  for (const Triangle& t : mesh.triangles)
    sixfold += (mesh.vertices[t[0]] - origin)
                   .dot((mesh.vertices[t[1]] - origin).cross(mesh.vertices[t[2]] - origin));
  return sixfold / 6.0;
}

std::vector<Eigen::Vector3f> estimate_vertex_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const Triangle& triangle : mesh.triangles) {
    const Eigen::Vector3d normal = area_normal(mesh, triangle);
    for (const std::uint32_t index : triangle) sums[index] += normal;
  }
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(sums.size());
  for (const Eigen::Vector3d& sum : sums) normals.push_back(sum.normalized().cast<float>());
  return normals;
}

namespace {

void require_one_per_triangle(const TexturedMesh& model, const char* name, std::size_t count) {
  if (count == model.mesh.triangles.size()) return;
  throw Error("not one value per triangle", {.field = name,
                                             .value = std::to_string(count) + " values",
                                             .bound = std::to_string(model.mesh.triangles.size())});
}

}  // namespace

void TexturedMesh::check() const {
  mesh.check();
  require_one_per_triangle(*this, "texture_coordinates", texture_coordinates.size());
  require_one_per_triangle(*this, "page_of_triangle", page_of_triangle.size());
  for (std::size_t t = 0; t < page_of_triangle.size(); ++t) {
    const std::int32_t page = page_of_triangle[t];
    if (page != no_page && (page < 0 || static_cast<std::size_t>(page) >= pages.size()))
      throw Error("does not exist", {.field = "texture page of triangle " + std::to_string(t),
                                     .value = std::to_string(page),
                                     .bound = ">= -1 and < " + std::to_string(pages.size())});
    for (const Eigen::Vector2f& corner : texture_coordinates[t])
      if (!corner.allFinite())
        throw Error("texture coordinate is not finite", {.field = "triangle " + std::to_string(t)});
  }
}

}  // namespace libmap
