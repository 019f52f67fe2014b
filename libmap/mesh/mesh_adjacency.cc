#include "libmap/mesh/mesh_adjacency.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libmap {

namespace {

constexpr std::size_t max_triangles = no_edge / 3;
constexpr std::size_t exact_diameter_points = 2000;

std::uint32_t higher_vertex(const std::vector<Triangle>& triangles, HalfEdge h) {
  return std::max(source_of(triangles, h), target_of(triangles, h));
}

// Half-edges sorted by the lower vertex of their edge; `bucket` receives the first index by vertex.
std::vector<HalfEdge> by_lower_vertex(const std::vector<Triangle>& triangles, std::size_t vertices,
                                      std::vector<std::uint32_t>& bucket) {
  bucket.assign(vertices + 1, 0);
  const auto for_each = [&](const auto& body) {
    for (HalfEdge t = 0; t < triangles.size(); ++t) {
      const Triangle& corners = triangles[t];
      if (has_repeated_vertex(corners)) continue;
      for (HalfEdge k = 0; k < 3; ++k) body(std::min(corners[k], corners[(k + 1) % 3]), 3 * t + k);
    }
  };
  for_each([&](std::uint32_t low, HalfEdge) { ++bucket[low + 1]; });
  std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());
  std::vector<std::uint32_t> next(bucket.begin(), bucket.end() - 1);
  std::vector<HalfEdge> sorted(bucket.back());
  for_each([&](std::uint32_t low, HalfEdge h) { sorted[next[low]++] = h; });
  return sorted;
}

// The other half-edge of the triangle at the vertex `at`.
HalfEdge other_edge_at(const std::vector<Triangle>& triangles, HalfEdge h, std::uint32_t at) {
  return source_of(triangles, h) == at ? previous_in_triangle(h) : next_in_triangle(h);
}

// The open half-edge at the other end of the fan that starts with `h` at the vertex `at`; no_edge
// if the fan ends at a non-manifold edge.
HalfEdge across_fan(const std::vector<Triangle>& triangles, const std::vector<HalfEdge>& opposite,
                    HalfEdge h, std::uint32_t at) {
  // Terminates even if the adjacency is inconsistent.
  for (std::size_t step = 0; step < triangles.size(); ++step) {
    h = other_edge_at(triangles, h, at);
    if (opposite[h] == open_edge) return h;
    if (!is_joined(opposite[h])) return no_edge;
    h = opposite[h];
  }
  return no_edge;
}

// Extreme points along even directions of a half-sphere: any direction is within 0.06 rad of one.
std::vector<Eigen::Vector3d> extreme_points(const std::vector<Eigen::Vector3d>& points) {
  constexpr int directions = 900;
  const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> extreme;
  for (int n = 0; n < directions; ++n) {
    const double z = (n + 0.5) / directions;
    const double r = std::sqrt(1.0 - z * z);
    const Eigen::Vector3d direction(r * std::cos(n * golden_angle), r * std::sin(n * golden_angle),
                                    z);
    const auto [low, high] = std::minmax_element(
        points.begin(), points.end(), [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
          return direction.dot(a) < direction.dot(b);
        });
    extreme.push_back(*low);
    extreme.push_back(*high);
  }
  return extreme;
}

}  // namespace

MeshEdges edges_of(const std::vector<Triangle>& triangles, std::size_t vertices) {
  if (triangles.size() >= max_triangles)
    throw Error("the mesh is too large", {.field = "triangles",
                                          .value = std::to_string(triangles.size()),
                                          .bound = "< " + std::to_string(max_triangles)});
  MeshEdges edges;
  std::vector<std::uint32_t> bucket;
  edges.half_edges = by_lower_vertex(triangles, vertices, bucket);
  edges.first.reserve(edges.half_edges.size() / 2 + 1);
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto begin = edges.half_edges.begin() + bucket[v];
    const auto end = edges.half_edges.begin() + bucket[v + 1];
    std::sort(begin, end, [&](HalfEdge a, HalfEdge b) {
      return std::pair(higher_vertex(triangles, a), a) < std::pair(higher_vertex(triangles, b), b);
    });
    for (auto h = begin; h != end; ++h)
      if (h == begin || higher_vertex(triangles, *h) != higher_vertex(triangles, *(h - 1)))
        edges.first.push_back(static_cast<std::uint32_t>(h - edges.half_edges.begin()));
  }
  edges.first.push_back(static_cast<std::uint32_t>(edges.half_edges.size()));
  return edges;
}

std::vector<HalfEdge> opposites_of(const std::vector<Triangle>& triangles, const MeshEdges& edges) {
  std::vector<HalfEdge> opposite(3 * triangles.size(), no_edge);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const HalfEdge* half = &edges.half_edges[edges.first[e]];
    const std::size_t count = edges.count(e);
    if (count == 2) {
      opposite[half[0]] = half[1];
      opposite[half[1]] = half[0];
    } else {
      for (std::size_t n = 0; n < count; ++n)
        opposite[half[n]] = count == 1 ? open_edge : non_manifold_edge;
    }
  }
  return opposite;
}

VertexTriangles triangles_at_vertices(const std::vector<Triangle>& triangles,
                                      std::size_t vertices) {
  VertexTriangles result;
  result.first.assign(vertices + 1, 0);
  for (const Triangle& t : triangles)
    for (const std::uint32_t v : t) ++result.first[v + 1];
  std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
  std::vector<std::uint32_t> next(result.first.begin(), result.first.end() - 1);
  result.triangles.resize(result.first.back());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (const std::uint32_t v : triangles[t]) result.triangles[next[v]++] = t;
  return result;
}

std::vector<HalfEdge> corner_fans(const std::vector<Triangle>& triangles,
                                  const std::vector<HalfEdge>& opposite) {
  DisjointSets<HalfEdge> sets(opposite.size());
  for (HalfEdge h = 0; h < opposite.size(); ++h) {
    const HalfEdge other = opposite[h];
    if (!is_joined(other) || other < h) continue;
    const bool same_sense = source_of(triangles, h) == source_of(triangles, other);
    sets.join(h, same_sense ? other : next_in_triangle(other));
    sets.join(next_in_triangle(h), same_sense ? next_in_triangle(other) : other);
  }
  std::vector<HalfEdge> fans(opposite.size());
  for (HalfEdge n = 0; n < fans.size(); ++n) fans[n] = sets.find(n);
  return fans;
}

std::vector<std::vector<HalfEdge>> boundary_loops(const std::vector<Triangle>& triangles,
                                                  const std::vector<HalfEdge>& opposite) {
  std::vector<std::vector<HalfEdge>> loops;
  std::vector<bool> passed(opposite.size(), false);
  for (HalfEdge start = 0; start < opposite.size(); ++start) {
    if (opposite[start] != open_edge || passed[start]) continue;
    std::vector<HalfEdge>& loop = loops.emplace_back();
    HalfEdge h = start;
    std::uint32_t at = source_of(triangles, h);
    while (h != no_edge && !passed[h]) {
      passed[h] = true;
      loop.push_back(h);
      h = across_fan(triangles, opposite, h, at);
      if (h != no_edge)
        at = source_of(triangles, h) == at ? target_of(triangles, h) : source_of(triangles, h);
    }
  }
  return loops;
}

void dilate_mask(const TriangleMesh& mesh, int rings, std::vector<bool>& marks) {
  std::vector<bool> touched(mesh.vertices.size());
  for (int ring = 0; ring < rings; ++ring) {
    touched.assign(mesh.vertices.size(), false);
    for (std::size_t t = 0; t < marks.size(); ++t)
      if (marks[t])
        for (const std::uint32_t v : mesh.triangles[t]) touched[v] = true;
    for (std::size_t t = 0; t < marks.size(); ++t)
      for (const std::uint32_t v : mesh.triangles[t])
        if (touched[v]) marks[t] = true;
  }
}

double diameter_of(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() > exact_diameter_points) return diameter_of(extreme_points(points));
  double largest = 0.0;
  for (std::size_t a = 0; a < points.size(); ++a)
    for (std::size_t b = a + 1; b < points.size(); ++b)
      largest = std::max(largest, (points[a] - points[b]).squaredNorm());
  return std::sqrt(largest);
}

}  // namespace libmap
