#include "libmap/texture/texture_steps.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = 0xffffffff;
constexpr std::size_t edges_per_chunk = 1024;
// Relative to the largest coordinate. Shorter sides are not halved: rounding moves their middles.
constexpr double min_side = 1e-12;

double largest_coordinate(const TriangleMesh& mesh) {
  double largest = 0.0;
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    largest = std::max(largest, vertex.cwiseAbs().maxCoeff());
  return largest;
}

bool is_long(const TriangleMesh& mesh, HalfEdge h, double max_side_m) {
  return along(mesh, h).squaredNorm() > max_side_m * max_side_m;
}

// Clears `open` of triangles that need no cutting; their parts need none either.
void close_triangles(const TriangleMesh& mesh, double max_side_m, const NeedsCutting& needs_cutting,
                     std::vector<std::uint8_t>& open) {
  parallel_each(open.size(), edges_per_chunk, [&](std::size_t t) {
    if (open[t] == 0) return;
    const auto h = static_cast<HalfEdge>(3 * t);
    const bool any_long = is_long(mesh, h, max_side_m) || is_long(mesh, h + 1, max_side_m) ||
                          is_long(mesh, h + 2, max_side_m);
    if (!any_long || !needs_cutting(mesh, mesh.triangles[t])) open[t] = 0;
  });
}

// The long edges of open triangles.
std::vector<std::uint32_t> edges_to_halve(const TriangleMesh& mesh, const MeshEdges& edges,
                                          double max_side_m,
                                          const std::vector<std::uint8_t>& open) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const auto first = edges.half_edges.begin() + edges.first[e];
    if (is_long(mesh, *first, max_side_m) &&
        std::any_of(first, edges.half_edges.begin() + edges.first[e + 1],
                    [&open](HalfEdge h) { return open[h / 3] != 0; }))
      found.push_back(e);
  }
  return found;
}

// Number of triangles added: one per halved side of each triangle.
std::uint64_t new_triangles(const MeshEdges& edges, const std::vector<std::uint32_t>& halved) {
  std::uint64_t count = 0;
  for (const std::uint32_t e : halved) count += edges.count(e);
  return count;
}

// Adds the middle vertices. Returns the index of one per half-edge; no_vertex if it is not halved.
std::vector<std::uint32_t> add_middles(TriangleMesh& mesh, const MeshEdges& edges,
                                       const std::vector<std::uint32_t>& halved) {
  std::vector<std::uint32_t> middles(3 * mesh.triangles.size(), no_vertex);
  for (const std::uint32_t e : halved) {
    const HalfEdge h = edges.half_edges[edges.first[e]];
    const std::uint32_t a = source_of(mesh.triangles, h);
    const std::uint32_t b = target_of(mesh.triangles, h);
    const std::uint32_t middle = append_vertex_between(mesh, std::min(a, b), std::max(a, b), 0.5);
    for (std::size_t i = edges.first[e]; i < edges.first[e + 1]; ++i)
      middles[edges.half_edges[i]] = middle;
  }
  return middles;
}

// Splits a triangle at the middles of its sides. The orientation is kept.
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
  // Rotates until only side 0 has a middle, or only side 2 has none.
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
  // Splits the quadrangle t0 m0 m1 t2 along its shorter diagonal.
  const auto distance = [&mesh](std::uint32_t a, std::uint32_t b) {
    return (mesh.vertices[a] - mesh.vertices[b]).squaredNorm();
  };
  if (distance(t[0], middles[1]) <= distance(middles[0], t[2]))
    return {tip, {t[0], middles[0], middles[1]}, {t[0], middles[1], t[2]}};
  return {tip, {t[0], middles[0], t[2]}, {middles[0], middles[1], t[2]}};
}

void cut(SubdivisionResult& result, std::vector<std::uint8_t>& open,
         const std::vector<std::uint32_t>& middles) {
  TriangleMesh& fine = result.mesh;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> source;
  std::vector<std::uint8_t> open_parts;
  triangles.reserve(fine.triangles.size());
  source.reserve(fine.triangles.size());
  open_parts.reserve(fine.triangles.size());
  for (std::size_t t = 0; t < fine.triangles.size(); ++t)
    for (const Triangle& part : parts_of(
             fine, fine.triangles[t], {middles[3 * t], middles[3 * t + 1], middles[3 * t + 2]})) {
      triangles.push_back(part);
      source.push_back(result.source[t]);
      open_parts.push_back(open[t]);
    }
  fine.triangles = std::move(triangles);
  result.source = std::move(source);
  open = std::move(open_parts);
}

}  // namespace

SubdivisionResult split_long_sides(TriangleMesh mesh, double max_side_m,
                                   std::uint64_t max_triangles, const NeedsCutting& needs_cutting) {
  SubdivisionResult result;
  const std::vector<ScalarField> face_fields = mesh.face_fields;
  result.max_side_m = std::max(max_side_m, min_side * largest_coordinate(mesh));
  result.source.resize(mesh.triangles.size());
  for (std::uint32_t t = 0; t < result.source.size(); ++t) result.source[t] = t;
  const std::uint64_t most = std::max<std::uint64_t>(max_triangles, 2 * mesh.triangles.size());
  std::vector<std::uint8_t> open(mesh.triangles.size(), 1);
  TriangleMesh& fine = result.mesh = std::move(mesh);
  for (;;) {
    close_triangles(fine, result.max_side_m, needs_cutting, open);
    const MeshEdges edges = edges_of(fine.triangles, fine.vertices.size());
    std::vector<std::uint32_t> halved = edges_to_halve(fine, edges, result.max_side_m, open);
    while (fine.triangles.size() + new_triangles(edges, halved) > most) {
      result.max_side_m *= 1.25;
      halved = edges_to_halve(fine, edges, result.max_side_m, open);
    }
    if (halved.empty()) break;
    cut(result, open, add_middles(fine, edges, halved));
  }
  for (std::size_t f = 0; f < fine.face_fields.size(); ++f) {
    std::vector<double> values;
    values.reserve(result.source.size());
    for (const std::uint32_t t : result.source) values.push_back(face_fields[f].values[t]);
    fine.face_fields[f].values = std::move(values);
  }
  return result;
}

}  // namespace libmap
