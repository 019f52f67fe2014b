#include "libmap/mesh/mesh_subdivision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = 0xffffffff;

double squared_length(const TriangleMesh& mesh, HalfEdge h) {
  return (mesh.vertices[source_of(mesh.triangles, h)] - mesh.vertices[target_of(mesh.triangles, h)])
      .squaredNorm();
}

double longest_side(const TriangleMesh& mesh, std::uint32_t t) {
  return std::sqrt(std::max({squared_length(mesh, 3 * t), squared_length(mesh, 3 * t + 1),
                             squared_length(mesh, 3 * t + 2)}));
}

// A side that some 3/4 (longest / side)^2 triangles of each triangle are not too many for.
double affordable_side(const TriangleMesh& mesh, double max_side_m, std::uint64_t most_triangles) {
  for (;; max_side_m *= 1.25) {
    double count = 0.0;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const double ratio = longest_side(mesh, t) / max_side_m;
      count += ratio > 1.0 ? 2.0 * ratio * ratio : 1.0;
    }
    if (count <=
        static_cast<double>(std::max<std::uint64_t>(most_triangles, 2 * mesh.triangles.size() + 1)))
      return max_side_m;
  }
}

// The vertex in the middle of each half-edge that is too long.
std::vector<std::uint32_t> add_middles(TriangleMesh& mesh, double max_side_m, bool& any) {
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  std::vector<std::uint32_t> middles(3 * mesh.triangles.size(), no_vertex);
  any = false;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const HalfEdge h = edges.half_edges[edges.first[e]];
    if (!(squared_length(mesh, h) > max_side_m * max_side_m)) continue;
    const std::uint32_t a = source_of(mesh.triangles, h);
    const std::uint32_t b = target_of(mesh.triangles, h);
    const std::uint32_t middle = append_vertex_between(mesh, std::min(a, b), std::max(a, b), 0.5);
    for (std::size_t i = edges.first[e]; i < edges.first[e + 1]; ++i)
      middles[edges.half_edges[i]] = middle;
    any = true;
  }
  return middles;
}

// The parts of a triangle whose sides have these middles, in its own sense.
std::vector<Triangle> parts_of(const TriangleMesh& mesh, Triangle t,
                               std::array<std::uint32_t, 3> middles) {
  const auto count =
      std::count_if(middles.begin(), middles.end(), [](std::uint32_t m) { return m != no_vertex; });
  if (count == 0) return {t};
  if (count == 3)
    return {{t[0], middles[0], middles[2]},
            {middles[0], t[1], middles[1]},
            {middles[2], middles[1], t[2]},
            {middles[0], middles[1], middles[2]}};
  // Turned so that side 0 is the only one with a middle, or side 2 the only one without.
  const auto turn = [&] {
    std::rotate(t.begin(), t.begin() + 1, t.end());
    std::rotate(middles.begin(), middles.begin() + 1, middles.end());
  };
  if (count == 1) {
    while (middles[0] == no_vertex) turn();
    return {{t[0], middles[0], t[2]}, {middles[0], t[1], t[2]}};
  }
  while (middles[2] != no_vertex) turn();
  const Triangle tip = {middles[0], t[1], middles[1]};
  // The quadrangle t0 m0 m1 t2, cut along its shorter diagonal.
  const auto distance = [&mesh](std::uint32_t a, std::uint32_t b) {
    return (mesh.vertices[a] - mesh.vertices[b]).squaredNorm();
  };
  if (distance(t[0], middles[1]) <= distance(middles[0], t[2]))
    return {tip, {t[0], middles[0], middles[1]}, {t[0], middles[1], t[2]}};
  return {tip, {t[0], middles[0], t[2]}, {middles[0], middles[1], t[2]}};
}

}  // namespace

SubdivisionResult split_long_sides(const TriangleMesh& mesh, double max_side_m,
                                   std::uint64_t most_triangles) {
  SubdivisionResult result;
  result.mesh = mesh;
  result.max_side_m = affordable_side(mesh, max_side_m, most_triangles);
  result.source.resize(mesh.triangles.size());
  for (std::uint32_t t = 0; t < result.source.size(); ++t) result.source[t] = t;
  TriangleMesh& fine = result.mesh;
  for (;;) {
    bool any = false;
    const std::vector<std::uint32_t> middles = add_middles(fine, result.max_side_m, any);
    if (!any) break;
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> source;
    for (std::size_t t = 0; t < fine.triangles.size(); ++t)
      for (const Triangle& part : parts_of(
               fine, fine.triangles[t], {middles[3 * t], middles[3 * t + 1], middles[3 * t + 2]})) {
        triangles.push_back(part);
        source.push_back(result.source[t]);
      }
    fine.triangles = std::move(triangles);
    result.source = std::move(source);
  }
  for (std::size_t f = 0; f < fine.face_fields.size(); ++f) {
    std::vector<double> values;
    values.reserve(result.source.size());
    for (const std::uint32_t t : result.source) values.push_back(mesh.face_fields[f].values[t]);
    fine.face_fields[f].values = std::move(values);
  }
  return result;
}

}  // namespace libmap
