#include "libmap/mesh/mesh_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "libmap/core/error.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libmap {

namespace {

constexpr std::uint32_t unused = 0xffffffff;

std::vector<ScalarField> picked(const std::vector<ScalarField>& fields,
                                const std::vector<std::uint32_t>& from) {
  std::vector<ScalarField> result;
  for (const ScalarField& field : fields) {
    ScalarField& copy = result.emplace_back(ScalarField{field.name, field.type, {}});
    copy.values.reserve(from.size());
    for (const std::uint32_t n : from) copy.values.push_back(field.values[n]);
  }
  return result;
}

template <typename T>
std::vector<T> picked(const std::vector<T>& values, const std::vector<std::uint32_t>& from) {
  std::vector<T> result;
  if (values.empty()) return result;
  result.reserve(from.size());
  for (const std::uint32_t n : from) result.push_back(values[n]);
  return result;
}

Eigen::Vector3f unit_or_zero(const Eigen::Vector3f& vector) {
  const float length = vector.norm();
  return length > 0.0F ? Eigen::Vector3f(vector / length) : Eigen::Vector3f::Zero();
}

template <std::size_t N>
Color blended(const std::array<Color, N>& colors, const std::array<double, N>& weights) {
  Color result{};
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (std::size_t n = 0; n < N; ++n) sum += weights[n] * colors[n][c];
    result[c] = static_cast<std::uint8_t>(std::clamp(std::lround(sum), 0L, 255L));
  }
  return result;
}

template <std::size_t N>
double blended(const ScalarField& field, const std::array<std::uint32_t, N>& vertices,
               const std::array<double, N>& weights) {
  if (is_integer(field.type)) {
    const auto nearest = std::max_element(weights.begin(), weights.end()) - weights.begin();
    return field.values[vertices[static_cast<std::size_t>(nearest)]];
  }
  double sum = 0.0;
  // Vertices without weight are skipped, since their values may not be finite.
  for (std::size_t n = 0; n < N; ++n)
    if (weights[n] != 0.0) sum += weights[n] * field.values[vertices[n]];
  return sum;
}

// A set is represented by its first triangle.
MeshComponents numbered(const TriangleMesh& mesh, DisjointSets<std::uint32_t>& sets) {
  MeshComponents components;
  components.of_triangle.resize(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t root = sets.find(t);
    if (root == t) {
      components.of_triangle[t] = static_cast<std::uint32_t>(components.areas_m2.size());
      components.areas_m2.push_back(0.0);
    } else {
      components.of_triangle[t] = components.of_triangle[root];
    }
    components.areas_m2[components.of_triangle[t]] +=
        area_normal(mesh, mesh.triangles[t]).norm() / 2.0;
  }
  return components;
}

}  // namespace

std::size_t count_of(const std::vector<bool>& marks) {
  return static_cast<std::size_t>(std::count(marks.begin(), marks.end(), true));
}

TriangleMesh select_triangles(const TriangleMesh& mesh, const std::vector<bool>& keep_triangle) {
  if (keep_triangle.size() != mesh.triangles.size())
    throw Error("differs from the number of triangles",
                {.field = "number of marks of triangles",
                 .value = std::to_string(keep_triangle.size()),
                 .bound = std::to_string(mesh.triangles.size())});
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> new_index(mesh.vertices.size(), unused);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keep_triangle[t]) continue;
    triangles.push_back(t);
    for (const std::uint32_t v : mesh.triangles[t]) new_index[v] = 0;
  }
  std::vector<std::uint32_t> vertices;
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    if (new_index[v] == unused) continue;
    new_index[v] = static_cast<std::uint32_t>(vertices.size());
    vertices.push_back(v);
  }
  TriangleMesh part;
  part.vertices = picked(mesh.vertices, vertices);
  part.vertex_normals = picked(mesh.vertex_normals, vertices);
  part.vertex_colors = picked(mesh.vertex_colors, vertices);
  part.vertex_fields = picked(mesh.vertex_fields, vertices);
  part.face_fields = picked(mesh.face_fields, triangles);
  part.triangles.reserve(triangles.size());
  for (const std::uint32_t t : triangles) {
    const Triangle& corners = mesh.triangles[t];
    part.triangles.push_back({new_index[corners[0]], new_index[corners[1]], new_index[corners[2]]});
  }
  return part;
}

MeshComponents connected_components(const TriangleMesh& mesh) {
  DisjointSets<std::uint32_t> sets(mesh.triangles.size());
  std::unordered_map<std::uint64_t, std::uint32_t> triangle_at;
  triangle_at.reserve(2 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corners = mesh.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(corners[k], corners[(k + 1) % 3]);
      const auto [entry, is_new] =
          triangle_at.try_emplace((static_cast<std::uint64_t>(low) << 32U) | high, t);
      if (!is_new) sets.join(entry->second, t);
    }
  }
  return numbered(mesh, sets);
}

MeshComponents connected_components(const TriangleMesh& mesh,
                                    const std::vector<HalfEdge>& opposite) {
  const auto is_manifold = [](HalfEdge other) { return is_joined(other) || other == open_edge; };
  if (!std::all_of(opposite.begin(), opposite.end(), is_manifold))
    return connected_components(mesh);
  DisjointSets<std::uint32_t> sets(mesh.triangles.size());
  for (HalfEdge h = 0; h < opposite.size(); ++h)
    if (is_joined(opposite[h]) && opposite[h] < h) sets.join(opposite[h] / 3, h / 3);
  return numbered(mesh, sets);
}

std::uint32_t append_vertex_between(TriangleMesh& mesh, std::uint32_t a, std::uint32_t b,
                                    double t) {
  const std::array<std::uint32_t, 2> ends = {a, b};
  const std::array<double, 2> weights = {1.0 - t, t};
  const auto index = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.emplace_back(weights[0] * mesh.vertices[a] + weights[1] * mesh.vertices[b]);
  if (!mesh.vertex_normals.empty())
    mesh.vertex_normals.push_back(
        unit_or_zero(static_cast<float>(weights[0]) * mesh.vertex_normals[a] +
                     static_cast<float>(weights[1]) * mesh.vertex_normals[b]));
  if (!mesh.vertex_colors.empty())
    mesh.vertex_colors.push_back(
        blended<2>({mesh.vertex_colors[a], mesh.vertex_colors[b]}, weights));
  for (ScalarField& field : mesh.vertex_fields)
    field.values.push_back(blended<2>(field, ends, weights));
  return index;
}

TriangleMesh transform_mesh(const TriangleMesh& mesh, const Pose& target_from_source) {
  TriangleMesh moved = mesh;
  for (Eigen::Vector3d& vertex : moved.vertices) vertex = target_from_source * vertex;
  const Eigen::Matrix3f rotation = target_from_source.linear().cast<float>();
  for (Eigen::Vector3f& normal : moved.vertex_normals) normal = rotation * normal;
  return moved;
}

std::array<TriangleCorners, 4> quarters_of(const TriangleCorners& corners) {
  const auto& [a, b, c] = corners;
  const Eigen::Vector3d ab = (a + b) / 2.0;
  const Eigen::Vector3d bc = (b + c) / 2.0;
  const Eigen::Vector3d ca = (c + a) / 2.0;
  return {{{ab, bc, ca}, {a, ab, ca}, {ab, b, bc}, {ca, bc, c}}};
}

Eigen::Vector3d position_on(const TriangleMesh& mesh, const TrianglePoint& point) {
  const Triangle& corners = mesh.triangles[point.triangle];
  return (1.0 - point.u - point.v) * mesh.vertices[corners[0]] +
         point.u * mesh.vertices[corners[1]] + point.v * mesh.vertices[corners[2]];
}

PointCloud points_on_surface(const TriangleMesh& mesh, const std::vector<TrianglePoint>& points) {
  PointCloud cloud;
  cloud.positions.reserve(points.size());
  cloud.normals.reserve(points.size());
  for (const std::vector<ScalarField>* fields : {&mesh.vertex_fields, &mesh.face_fields})
    for (const ScalarField& field : *fields)
      if (cloud.find_field(field.name) == nullptr) {
        cloud.fields.push_back({field.name, field.type, {}});
        cloud.fields.back().values.reserve(points.size());
      }
  for (const TrianglePoint& point : points) {
    const Triangle& corners = mesh.triangles[point.triangle];
    const std::array<double, 3> weights = {1.0 - point.u - point.v, point.u, point.v};
    cloud.positions.push_back(position_on(mesh, point));
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    if (!mesh.vertex_normals.empty())
      for (std::size_t k = 0; k < 3; ++k)
        normal += static_cast<float>(weights[k]) * mesh.vertex_normals[corners[k]];
    if (normal.squaredNorm() == 0.0F)
      normal = area_normal(mesh, corners).normalized().cast<float>();
    cloud.normals.push_back(unit_or_zero(normal));
    if (!mesh.vertex_colors.empty())
      cloud.colors.push_back(
          blended<3>({mesh.vertex_colors[corners[0]], mesh.vertex_colors[corners[1]],
                      mesh.vertex_colors[corners[2]]},
                     weights));
    std::size_t next = 0;
    for (const ScalarField& field : mesh.vertex_fields)
      cloud.fields[next++].values.push_back(blended<3>(field, corners, weights));
    for (const ScalarField& field : mesh.face_fields) {
      if (next >= cloud.fields.size() || cloud.fields[next].name != field.name) continue;
      cloud.fields[next++].values.push_back(field.values[point.triangle]);
    }
  }
  return cloud;
}

}  // namespace libmap
