// Meshes of known shape.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "libmap/core/triangle_mesh.h"

namespace graspmap_test {

// A square about the z axis at that height, from -half to half, normal up.
inline libmap::TriangleMesh square_mesh(double z, double half = 1.0) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{-half, -half, z}, {half, -half, z}, {half, half, z}, {-half, half, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

// A closed ball, its vertices on the sphere, of rows x columns quads.
inline libmap::TriangleMesh ball_mesh(std::uint32_t rows, std::uint32_t columns,
                                      const Eigen::Vector3d& center, double radius = 1.0) {
  libmap::TriangleMesh mesh;
  for (std::uint32_t r = 0; r <= rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const double polar = std::numbers::pi * r / rows;
      const double around = 2 * std::numbers::pi * c / columns;
      mesh.vertices.push_back(center + radius * Eigen::Vector3d(std::sin(polar) * std::cos(around),
                                                                std::sin(polar) * std::sin(around),
                                                                std::cos(polar)));
    }
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const std::uint32_t d = (c + 1) % columns;
      const std::uint32_t a = r * columns;
      const std::uint32_t b = a + columns;
      mesh.triangles.push_back({a + c, b + c, b + d});
      mesh.triangles.push_back({a + c, b + d, a + d});
    }
  return mesh;
}

// Triangles of `base` followed by those of `addition`, without normals, colors and fields.
inline libmap::TriangleMesh join_meshes(const libmap::TriangleMesh& base,
                                        const libmap::TriangleMesh& addition) {
  libmap::TriangleMesh joined;
  joined.vertices = base.vertices;
  joined.vertices.insert(joined.vertices.end(), addition.vertices.begin(), addition.vertices.end());
  joined.triangles = base.triangles;
  const auto shift = static_cast<std::uint32_t>(base.vertices.size());
  for (const libmap::Triangle& t : addition.triangles)
    joined.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  return joined;
}

}  // namespace graspmap_test
