// Topology of a triangle mesh for tests, computed from its edges without a mesh library.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace graspmap_test {

struct Topology {
  std::size_t open_edges = 0;  // with one triangle
  std::size_t bad_edges = 0;   // with more than two, or with two that disagree on their sides
  std::size_t unused_vertices = 0;
  std::size_t parts = 0;  // connected by edges
  long euler = 0;         // vertices - edges + triangles: 2 a ball, 1 a disc
};

inline Topology topology_of(std::size_t vertices, const std::vector<libmap::Triangle>& triangles) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::size_t>> directed;
  for (std::size_t n = 0; n < triangles.size(); ++n)
    for (std::size_t k = 0; k < 3; ++k)
      directed[{triangles[n][k], triangles[n][(k + 1) % 3]}].push_back(n);
  Topology result;
  std::vector<std::size_t> parent(triangles.size());
  for (std::size_t n = 0; n < parent.size(); ++n) parent[n] = n;
  const auto root = [&](std::size_t n) {
    while (parent[n] != n) n = parent[n] = parent[parent[n]];
    return n;
  };
  long edges = 0;
  for (const auto& [edge, users] : directed) {
    const auto back = directed.find({edge.second, edge.first});
    const bool is_open = back == directed.end();
    if (is_open || edge.first < edge.second) ++edges;
    if (is_open) ++result.open_edges;
    if (users.size() != 1) ++result.bad_edges;
    if (!is_open) parent[root(users[0])] = root(back->second[0]);
  }
  std::set<std::uint32_t> used;
  std::set<std::size_t> roots;
  for (std::size_t n = 0; n < triangles.size(); ++n) {
    used.insert(triangles[n].begin(), triangles[n].end());
    roots.insert(root(n));
  }
  result.unused_vertices = vertices - used.size();
  result.parts = roots.size();
  result.euler = static_cast<long>(used.size()) - edges + static_cast<long>(triangles.size());
  return result;
}

// Pairs of triangles that intersect other than in a shared corner or edge (CGAL, exact).
std::size_t self_intersections(const std::vector<Eigen::Vector3d>& vertices,
                               const std::vector<libmap::Triangle>& triangles);

}  // namespace graspmap_test
