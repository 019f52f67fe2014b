// Surfaces whose topology is known.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace graspmap_test {

enum class Seam { open, closed, twisted };  // twisted: joined with the other direction reversed

// Triangulated quads of a rows x columns parameter grid, with vertices at `place(u, v)`, u (along
// rows) and v from 0 to 1. An open direction has one more line of vertices than quads.
inline libmap::TriangleMesh grid_mesh(std::uint32_t rows, std::uint32_t columns, Seam rows_seam,
                                      Seam columns_seam,
                                      const std::function<Eigen::Vector3d(double, double)>& place) {
  const std::uint32_t lines = rows + (rows_seam == Seam::open ? 1 : 0);
  const std::uint32_t width = columns + (columns_seam == Seam::open ? 1 : 0);
  libmap::TriangleMesh mesh;
  for (std::uint32_t r = 0; r < lines; ++r)
    for (std::uint32_t c = 0; c < width; ++c)
      mesh.vertices.push_back(
          place(static_cast<double>(r) / rows, static_cast<double>(c) / columns));
  const auto vertex = [&](std::uint32_t r, std::uint32_t c) {
    c = columns_seam == Seam::open ? c : c % columns;
    if (rows_seam != Seam::open && r == rows) {
      r = 0;
      if (rows_seam == Seam::twisted)
        c = columns_seam == Seam::open ? columns - c : (columns - c) % columns;
    }
    return r * width + c;
  };
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      mesh.triangles.push_back({vertex(r, c), vertex(r + 1, c), vertex(r + 1, c + 1)});
      mesh.triangles.push_back({vertex(r, c), vertex(r + 1, c + 1), vertex(r, c + 1)});
    }
  return mesh;
}

constexpr double turn = 2.0 * std::numbers::pi;

// Torus about the z axis; `minor` is the radius of the tube.
inline libmap::TriangleMesh torus_mesh(std::uint32_t rows, std::uint32_t columns, double major,
                                       double minor) {
  return grid_mesh(rows, columns, Seam::closed, Seam::closed, [=](double u, double v) {
    const double r = major + minor * std::cos(turn * v);
    return Eigen::Vector3d(r * std::cos(turn * u), r * std::sin(turn * u),
                           minor * std::sin(turn * v));
  });
}

inline libmap::TriangleMesh cylinder_mesh(std::uint32_t rows, std::uint32_t columns, double radius,
                                          double height) {
  return grid_mesh(rows, columns, Seam::open, Seam::closed, [=](double u, double v) {
    return Eigen::Vector3d(radius * std::cos(turn * v), radius * std::sin(turn * v), height * u);
  });
}

inline libmap::TriangleMesh moebius_mesh(std::uint32_t rows, std::uint32_t columns) {
  return grid_mesh(rows, columns, Seam::twisted, Seam::open, [](double u, double v) {
    const double across = 0.6 * (v - 0.5);
    const double r = 1.0 + across * std::cos(turn * u / 2.0);
    return Eigen::Vector3d(r * std::cos(turn * u), r * std::sin(turn * u),
                           across * std::sin(turn * u / 2.0));
  });
}

// Klein bottle, figure-eight immersion: it intersects itself along a circle.
inline libmap::TriangleMesh klein_mesh(std::uint32_t rows, std::uint32_t columns) {
  return grid_mesh(rows, columns, Seam::twisted, Seam::closed, [](double u, double v) {
    const double a = turn * u / 2.0;
    const double b = turn * (v + 0.013);
    const double r = 2.0 + std::cos(a) * std::sin(b) - std::sin(a) * std::sin(2.0 * b);
    return Eigen::Vector3d(r * std::cos(2.0 * a), r * std::sin(2.0 * a),
                           std::sin(a) * std::sin(b) + std::cos(a) * std::sin(2.0 * b));
  });
}

// Height field over a square about the origin, normals up.
inline libmap::TriangleMesh terrain_mesh(std::uint32_t cells, double size_m,
                                         const std::function<double(double, double)>& height) {
  return grid_mesh(cells, cells, Seam::open, Seam::open, [&](double u, double v) {
    const double x = size_m * (u - 0.5);
    const double y = size_m * (v - 0.5);
    return Eigen::Vector3d(x, y, height(x, y));
  });
}

// Geodesic ball: an octahedron divided `levels` times, with vertices on the sphere.
inline libmap::TriangleMesh geodesic_mesh(int levels, double radius,
                                          const Eigen::Vector3d& center = Eigen::Vector3d::Zero()) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                    {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [place, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.vertices.size()));
      if (is_new) {
        const Eigen::Vector3d sum = mesh.vertices[a] + mesh.vertices[b];
        mesh.vertices.push_back(sum.normalized());
      }
      return place->second;
    };
    std::vector<libmap::Triangle> divided;
    for (const auto& [a, b, c] : mesh.triangles) {
      const std::uint32_t ab = middle(a, b);
      const std::uint32_t bc = middle(b, c);
      const std::uint32_t ca = middle(c, a);
      for (const libmap::Triangle& t :
           {libmap::Triangle{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}})
        divided.push_back(t);
    }
    mesh.triangles = std::move(divided);
  }
  for (Eigen::Vector3d& v : mesh.vertices) v = center + radius * v;
  return mesh;
}

// Surface of unit cubes. Corners are shared, so cubes that touch only in an edge or a corner make
// it non-manifold.
inline libmap::TriangleMesh cubes_mesh(const std::set<std::array<int, 3>>& cubes) {
  libmap::TriangleMesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> vertices;
  const auto vertex = [&](const std::array<int, 3>& place) {
    const auto [found, is_new] =
        vertices.try_emplace(place, static_cast<std::uint32_t>(mesh.vertices.size()));
    if (is_new) mesh.vertices.emplace_back(place[0], place[1], place[2]);
    return found->second;
  };
  for (const std::array<int, 3>& cube : cubes)
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const int side : {0, 1}) {
        std::array<int, 3> beyond = cube;
        beyond[axis] += side == 1 ? 1 : -1;
        if (cubes.contains(beyond)) continue;
        const std::size_t b = (axis + 1) % 3;
        const std::size_t c = (axis + 2) % 3;
        std::array<std::uint32_t, 4> corners{};
        for (std::size_t n = 0; n < 4; ++n) {
          std::array<int, 3> place = cube;
          place[axis] += side;
          place[b] += n == 1 || n == 2 ? 1 : 0;
          place[c] += n >= 2 ? 1 : 0;
          corners[side == 1 ? n : 3 - n] = vertex(place);
        }
        mesh.triangles.push_back({corners[0], corners[1], corners[2]});
        mesh.triangles.push_back({corners[0], corners[2], corners[3]});
      }
  return mesh;
}

// A slab, one cube thick, of 2 n + 1 x 3 cubes with `n` holes: genus n.
inline libmap::TriangleMesh slab_with_holes(int holes) {
  std::set<std::array<int, 3>> cubes;
  for (int x = 0; x < 2 * holes + 1; ++x)
    for (int y = 0; y < 3; ++y)
      if (x % 2 == 0 || y != 1) cubes.insert({x, y, 0});
  return cubes_mesh(cubes);
}

}  // namespace graspmap_test
