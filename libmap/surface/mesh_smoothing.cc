#include "libmap/surface/mesh_smoothing.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_adjacency.h"

namespace libmap {

namespace {

constexpr double inward = 0.5;                                // lambda
constexpr double pass_band = 0.02;                            // k_PB = 1 / lambda + 1 / mu
constexpr double outward = 1.0 / (pass_band - 1.0 / inward);  // mu
constexpr std::size_t vertices_grain = 4096;

// The neighbors of each vertex that may move; those that stay have none.
struct Neighbors {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> vertices;
};

Neighbors neighbors_of(const TriangleMesh& mesh) {
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  const auto ends = [&](std::size_t e) {
    const HalfEdge h = edges.half_edges[edges.first[e]];
    return std::array<std::uint32_t, 2>{source_of(mesh.triangles, h), target_of(mesh.triangles, h)};
  };
  std::vector<bool> stays(mesh.vertices.size(), false);
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.count(e) != 2)
      for (const std::uint32_t v : ends(e)) stays[v] = true;
  Neighbors result;
  result.first.assign(mesh.vertices.size() + 1, 0);
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (const std::uint32_t v : ends(e))
      if (!stays[v]) ++result.first[v + 1];
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) result.first[v + 1] += result.first[v];
  result.vertices.resize(result.first.back());
  std::vector<std::uint32_t> place(result.first.begin(), result.first.end() - 1);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [a, b] = ends(e);
    if (!stays[a]) result.vertices[place[a]++] = b;
    if (!stays[b]) result.vertices[place[b]++] = a;
  }
  return result;
}

void step(const Neighbors& neighbors, double share, const std::vector<Eigen::Vector3d>& from,
          std::vector<Eigen::Vector3d>& to) {
  parallel_for(from.size(), vertices_grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Eigen::Vector3d towards = Eigen::Vector3d::Zero();
      double weights = 0.0;
      for (std::uint32_t n = neighbors.first[v]; n < neighbors.first[v + 1]; ++n) {
        const Eigen::Vector3d edge = from[neighbors.vertices[n]] - from[v];
        const double length = edge.norm();
        if (length == 0.0) continue;
        towards += edge / length;
        weights += 1.0 / length;
      }
      to[v] = weights > 0.0 ? Eigen::Vector3d(from[v] + share / weights * towards) : from[v];
    }
  });
}

}  // namespace

void smooth_mesh(TriangleMesh& mesh, int iterations) {
  if (iterations <= 0 || mesh.triangles.empty()) return;
  const Neighbors neighbors = neighbors_of(mesh);
  std::vector<Eigen::Vector3d> moved(mesh.vertices.size());
  for (int n = 0; n < iterations; ++n) {
    step(neighbors, inward, mesh.vertices, moved);
    step(neighbors, outward, moved, mesh.vertices);
  }
}

}  // namespace libmap
