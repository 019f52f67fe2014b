// A small site with an overhang.
#pragma once

#include <cmath>

#include "libmap/core/triangle_mesh.h"
#include "tests/libmap/mesh/mesh_samples.h"

namespace graspmap_test {

// Wavy ground of size x size about (0, 0), a vertex each `edge_m`: z = 0.02 sin(12 x) cos(9 y).
inline double wavy_height(double x, double y) { return 0.02 * std::sin(12 * x) * std::cos(9 * y); }
inline libmap::TriangleMesh wavy_ground(double size_m = 0.8, double edge_m = 0.01,
                                        double first_x_m = 0.0) {
  libmap::TriangleMesh mesh;
  const auto count = static_cast<std::uint32_t>(std::lround(size_m / edge_m));
  for (std::uint32_t row = 0; row <= count; ++row)
    for (std::uint32_t column = 0; column <= count; ++column) {
      const double x = first_x_m - size_m / 2 + column * edge_m;
      const double y = -size_m / 2 + row * edge_m;
      mesh.vertices.emplace_back(x, y, wavy_height(x, y));
    }
  for (std::uint32_t row = 0; row < count; ++row)
    for (std::uint32_t column = 0; column < count; ++column) {
      const std::uint32_t a = row * (count + 1) + column;
      mesh.triangles.push_back({a, a + 1, a + count + 2});
      mesh.triangles.push_back({a, a + count + 2, a + count + 1});
    }
  return mesh;
}

// The ground, and a boulder whose lower half overhangs it.
inline libmap::TriangleMesh ground_with_boulder() {
  return join_meshes(wavy_ground(), ball_mesh(24, 48, {0.1, 0.05, 0.13}, 0.12));
}

}  // namespace graspmap_test
