// Makes shapes on the ground for closing fingers.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "tests/libmap/mesh/mesh_samples.h"

namespace bullet_test {

using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;

// Body of revolution about z, from the top down; (r, z) in meters.
inline TriangleMesh revolved(const std::vector<Eigen::Vector2d>& outline, std::uint32_t sides) {
  TriangleMesh mesh;
  for (const Eigen::Vector2d& point : outline)
    for (std::uint32_t n = 0; n < sides; ++n) {
      const double angle = 2.0 * pi * (n + 0.5) / sides;
      mesh.vertices.emplace_back(point.x() * std::cos(angle), point.x() * std::sin(angle),
                                 point.y());
    }
  for (std::uint32_t row = 0; row + 1 < outline.size(); ++row)
    for (std::uint32_t n = 0; n < sides; ++n) {
      const std::uint32_t next = (n + 1) % sides;
      const std::uint32_t a = row * sides + n;
      const std::uint32_t b = row * sides + next;
      if (outline[row + 1].x() > 0.0) mesh.triangles.push_back({a, a + sides, b + sides});
      if (outline[row].x() > 0.0) mesh.triangles.push_back({a, b + sides, b});
    }
  return mesh;
}

// Makes the shape with its center at this height.
inline TriangleMesh sphere(double radius, double center, std::uint32_t sides = 96) {
  std::vector<Eigen::Vector2d> outline;
  const std::uint32_t rows = sides / 2;
  for (std::uint32_t n = 0; n <= rows; ++n) {
    const double angle = pi * n / rows;
    outline.emplace_back(n % rows == 0 ? 0.0 : radius * std::sin(angle),
                         center + radius * std::cos(angle));
  }
  return revolved(outline, sides);
}

inline TriangleMesh post(double radius, double height, std::uint32_t sides = 96) {
  return revolved({{0.0, height}, {radius, height}, {radius, 0.0}}, sides);
}

inline TriangleMesh cone(double radius, double height) {
  return revolved({{0.0, height}, {radius, 0.0}}, 96);
}

inline TriangleMesh box(double half_x, double half_y, double height) {
  TriangleMesh mesh = post(std::numbers::sqrt2, height, 4);
  for (Eigen::Vector3d& vertex : mesh.vertices) {
    vertex.x() *= half_x;
    vertex.y() *= half_y;
  }
  return mesh;
}

// Makes a ridge along x.
inline TriangleMesh wedge(double half_length, double half_width, double height) {
  TriangleMesh mesh;
  mesh.vertices = {{-half_length, 0.0, height},      {half_length, 0.0, height},
                   {-half_length, -half_width, 0.0}, {half_length, -half_width, 0.0},
                   {half_length, half_width, 0.0},   {-half_length, half_width, 0.0}};
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {0, 1, 4}, {0, 4, 5}, {0, 5, 2}, {1, 3, 4}};
  return mesh;
}

inline TriangleMesh field(double half, std::uint32_t cells,
                          const std::function<double(double, double)>& height) {
  TriangleMesh mesh;
  for (std::uint32_t row = 0; row <= cells; ++row)
    for (std::uint32_t column = 0; column <= cells; ++column) {
      const double x = half * (2.0 * column / cells - 1.0);
      const double y = half * (2.0 * row / cells - 1.0);
      mesh.vertices.emplace_back(x, y, height(x, y));
    }
  for (std::uint32_t row = 0; row < cells; ++row)
    for (std::uint32_t column = 0; column < cells; ++column) {
      const std::uint32_t a = row * (cells + 1) + column;
      const std::uint32_t c = a + cells + 1;
      mesh.triangles.push_back({a, a + 1, c + 1});
      mesh.triangles.push_back({a, c + 1, c});
    }
  return mesh;
}

inline TriangleMesh on_plane(const TriangleMesh& shape, double half) {
  return graspmap_test::join_meshes(field(half, 8, [](double, double) { return 0.0; }), shape);
}

struct Shape {
  std::string name;
  TriangleMesh mesh;
  Eigen::Vector3d location;  // top of the shape, or middle of a field
};

}  // namespace bullet_test
