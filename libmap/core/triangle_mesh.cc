#include "libmap/core/triangle_mesh.h"

#include <Eigen/Geometry>

#include "libmap/core/error.h"

namespace libmap {

namespace {

void require_length(const std::string& what, std::size_t length, std::size_t wanted) {
  if (length == wanted) return;
  throw Error("the mesh wants " + std::to_string(wanted),
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
        throw Error("there is no such vertex", {.field = "triangle " + std::to_string(i),
                                                .value = "vertex " + std::to_string(index),
                                                .bound = "< " + std::to_string(vertices.size())});
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
  // About a vertex and not the origin, which may be far away.
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

TriangleMesh join_meshes(const TriangleMesh& base, const TriangleMesh& addition) {
  TriangleMesh joined = base;
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  // Kept only if both sides have it, or one side has nothing at all to give.
  const auto append_optional = [&](auto& to, const auto& from) {
    const bool both = to.size() == base.vertices.size() && from.size() == addition.vertices.size();
    if (both) {
      append(to, from);
    } else {
      to.clear();
    }
  };
  const auto append_fields = [&](std::vector<ScalarField>& to,
                                 const std::vector<ScalarField>& from) {
    std::vector<ScalarField> kept;
    for (ScalarField& field : to)
      for (const ScalarField& other : from)
        if (other.name == field.name) {
          append(field.values, other.values);
          kept.push_back(std::move(field));
          break;
        }
    to = std::move(kept);
  };
  append(joined.vertices, addition.vertices);
  append_optional(joined.vertex_normals, addition.vertex_normals);
  append_optional(joined.vertex_colors, addition.vertex_colors);
  append_fields(joined.vertex_fields, addition.vertex_fields);
  append_fields(joined.face_fields, addition.face_fields);
  const auto shift = static_cast<std::uint32_t>(base.vertices.size());
  for (const Triangle& t : addition.triangles)
    joined.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  return joined;
}

}  // namespace libmap
