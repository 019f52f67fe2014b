#include "libmap/scenes/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

// A convex polyhedron, represented by its faces, that is clipped by one plane after another.
class ConvexBody {
 public:
  explicit ConvexBody(double bound_m) {
    for (int n = 0; n < 8; ++n)
      vertices_.emplace_back((n & 1) != 0 ? bound_m : -bound_m, (n & 2) != 0 ? bound_m : -bound_m,
                             (n & 4) != 0 ? bound_m : -bound_m);
    faces_ = {{{0, 4, 6, 2}, -1}, {{1, 3, 7, 5}, -1}, {{0, 1, 5, 4}, -1},
              {{2, 6, 7, 3}, -1}, {{0, 2, 3, 1}, -1}, {{4, 5, 7, 6}, -1}};
  }

  void cut(const HalfSpace& half_space, int label) {
    distances_.clear();
    for (const Eigen::Vector3d& vertex : vertices_)
      distances_.push_back(half_space.normal.dot(vertex) - half_space.offset_m);
    crossings_.clear();
    std::map<std::uint32_t, std::uint32_t> rim;  // edges of the new face, in reverse direction
    std::vector<Face> kept;
    for (const Face& face : faces_) {
      Face clipped{clip(face.corners, rim), face.label};
      if (clipped.corners.size() >= 3) kept.push_back(std::move(clipped));
    }
    faces_ = std::move(kept);
    if (rim.empty()) return;
    Face cap{{}, label};
    std::uint32_t corner = rim.begin()->first;
    for (std::size_t n = 0; n < rim.size(); ++n) {
      cap.corners.push_back(corner);
      const auto next = rim.find(corner);
      if (next == rim.end()) throw Error("the intersection of the half-spaces is degenerate");
      corner = next->second;
    }
    std::reverse(cap.corners.begin(), cap.corners.end());
    if (cap.corners.size() >= 3) faces_.push_back(std::move(cap));
  }

  Solid solid() const {
    Solid result;
    result.vertices = vertices_;
    for (const Face& face : faces_) {
      for (std::size_t n = 2; n < face.corners.size(); ++n) {
        result.triangles.push_back({face.corners[0], face.corners[n - 1], face.corners[n]});
        result.labels.push_back(face.label);
      }
    }
    drop_unused_vertices(result.vertices, result.triangles);
    return result;
  }

 private:
  struct Face {
    std::vector<std::uint32_t> corners;  // counter-clockwise from outside
    int label = 0;
  };

  std::uint32_t crossing(std::uint32_t a, std::uint32_t b) {
    const Edge edge = std::minmax(a, b);
    const auto found = crossings_.find(edge);
    if (found != crossings_.end()) return found->second;
    const double from = distances_[edge.first];
    const double to = distances_[edge.second];
    const double fraction = from / (from - to);
    const Eigen::Vector3d point =
        vertices_[edge.first] + fraction * (vertices_[edge.second] - vertices_[edge.first]);
    const auto vertex = static_cast<std::uint32_t>(vertices_.size());
    vertices_.push_back(point);
    crossings_.emplace(edge, vertex);
    return vertex;
  }

  // Part of a face inside the half-space. Its cut edge is added to `rim`.
  std::vector<std::uint32_t> clip(const std::vector<std::uint32_t>& corners,
                                  std::map<std::uint32_t, std::uint32_t>& rim) {
    std::vector<std::uint32_t> kept;
    std::uint32_t left = 0;
    std::uint32_t entered = 0;
    bool is_cut = false;
    for (std::size_t n = 0; n < corners.size(); ++n) {
      const std::uint32_t corner = corners[n];
      const std::uint32_t next = corners[(n + 1) % corners.size()];
      const bool is_in = distances_[corner] <= 0.0;
      if (is_in) kept.push_back(corner);
      if (is_in == (distances_[next] <= 0.0)) continue;
      const std::uint32_t vertex = crossing(corner, next);
      kept.push_back(vertex);
      (is_in ? left : entered) = vertex;
      is_cut = true;
    }
    if (is_cut) rim.emplace(left, entered);
    return kept;
  }

  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Face> faces_;
  std::vector<double> distances_;
  std::map<Edge, std::uint32_t> crossings_;
};

}  // namespace

Solid convex_solid(const std::vector<HalfSpace>& half_spaces, double bound_m) {
  ConvexBody body(bound_m);
  for (std::size_t n = 0; n < half_spaces.size(); ++n)
    body.cut(half_spaces[n], static_cast<int>(n));
  Solid solid = body.solid();
  if (solid.triangles.empty()) throw Error("their intersection is empty", {.field = "half-spaces"});
  if (std::find(solid.labels.begin(), solid.labels.end(), -1) != solid.labels.end())
    throw Error("the intersection of the half-spaces extends more than " + to_text(bound_m) +
                " m from the origin along an axis");
  return solid;
}

Solid ellipsoid_solid(const Eigen::Vector3d& radii_m, double edge_length_m) {
  // A triangular grid on each face of an octahedron is projected onto the sphere.
  const double quarter = 0.5 * M_PI * radii_m.maxCoeff();
  const auto steps = static_cast<int>(std::max(3.0, std::ceil(quarter / edge_length_m)));
  Solid solid;
  std::map<std::array<int, 3>, std::uint32_t> numbers;
  const auto number = [&](const std::array<int, 3>& grid) {
    const auto [entry, is_new] =
        numbers.emplace(grid, static_cast<std::uint32_t>(solid.vertices.size()));
    if (is_new) {
      // Equal angles give a more uniform vertex spacing than equal lengths.
      Eigen::Vector3d direction;
      for (std::size_t axis = 0; axis < 3; ++axis)
        direction[static_cast<Eigen::Index>(axis)] = std::sin(0.5 * M_PI * grid[axis] / steps);
      solid.vertices.push_back(direction.normalized().cwiseProduct(radii_m));
    }
    return entry->second;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const std::array<int, 3> sign = {(octant & 1) != 0 ? -1 : 1, (octant & 2) != 0 ? -1 : 1,
                                     (octant & 4) != 0 ? -1 : 1};
    const bool is_mirrored = sign[0] * sign[1] * sign[2] < 0;
    const auto corner = [&](int i, int j) {
      return number({sign[0] * i, sign[1] * j, sign[2] * (steps - i - j)});
    };
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      solid.triangles.push_back(is_mirrored ? Triangle{a, c, b} : Triangle{a, b, c});
    };
    for (int i = 0; i < steps; ++i) {
      for (int j = 0; i + j < steps; ++j) {
        add(corner(i, j), corner(i + 1, j), corner(i, j + 1));
        if (i + j + 1 < steps) add(corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
      }
    }
  }
  solid.labels.assign(solid.triangles.size(), 0);
  return solid;
}

void drop_unused_vertices(std::vector<Eigen::Vector3d>& vertices,
                          std::vector<Triangle>& triangles) {
  constexpr auto unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renumbered(vertices.size(), unused);
  std::vector<Eigen::Vector3d> used;
  for (Triangle& triangle : triangles)
    for (std::uint32_t& vertex : triangle) {
      if (renumbered[vertex] == unused) {
        renumbered[vertex] = static_cast<std::uint32_t>(used.size());
        used.push_back(vertices[vertex]);
      }
      vertex = renumbered[vertex];
    }
  vertices = std::move(used);
}

Solid sort_solid(const Solid& solid) {
  const auto key = [&](std::uint32_t n) {
    const Eigen::Vector3d& vertex = solid.vertices[n];
    return std::array<double, 3>{vertex.x(), vertex.y(), vertex.z()};
  };
  std::vector<std::uint32_t> order(solid.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  Solid result;
  result.vertices.reserve(order.size());
  std::vector<std::uint32_t> renumbered(order.size());
  for (const std::uint32_t n : order) {
    renumbered[n] = static_cast<std::uint32_t>(result.vertices.size());
    result.vertices.push_back(solid.vertices[n]);
  }
  std::vector<std::pair<Triangle, int>> triangles;
  triangles.reserve(solid.triangles.size());
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    Triangle triangle = solid.triangles[n];
    for (std::uint32_t& vertex : triangle) vertex = renumbered[vertex];
    std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()),
                triangle.end());
    triangles.emplace_back(triangle, solid.labels[n]);
  }
  std::sort(triangles.begin(), triangles.end());
  for (const auto& [triangle, label] : triangles) {
    result.triangles.push_back(triangle);
    result.labels.push_back(label);
  }
  return result;
}

Eigen::Vector2d HeightGrid::at(std::size_t column, std::size_t row) const {
  // The last point is exactly on the outline.
  const double u = static_cast<double>(column) / static_cast<double>(columns - 1);
  const double v = static_cast<double>(row) / static_cast<double>(rows - 1);
  return {size_x_m * (u - 0.5), size_y_m * (v - 0.5)};
}

Solid block_solid(const HeightGrid& top, double base_m) {
  Solid solid;
  const auto index = [&](std::size_t column, std::size_t row) {
    return static_cast<std::uint32_t>(row * top.columns + column);
  };
  for (std::size_t row = 0; row < top.rows; ++row) {
    for (std::size_t column = 0; column < top.columns; ++column) {
      const Eigen::Vector2d at = top.at(column, row);
      solid.vertices.emplace_back(at.x(), at.y(), top.heights_m[index(column, row)]);
    }
  }
  for (std::size_t row = 0; row + 1 < top.rows; ++row) {
    for (std::size_t column = 0; column + 1 < top.columns; ++column) {
      const std::uint32_t a = index(column, row);
      const std::uint32_t b = index(column + 1, row);
      const std::uint32_t c = index(column + 1, row + 1);
      const std::uint32_t d = index(column, row + 1);
      if ((row + column) % 2 == 0) {
        solid.triangles.insert(solid.triangles.end(), {Triangle{a, b, c}, Triangle{a, c, d}});
      } else {
        solid.triangles.insert(solid.triangles.end(), {Triangle{a, b, d}, Triangle{b, c, d}});
      }
    }
  }
  solid.labels.assign(solid.triangles.size(), 0);
  // The outline, counter-clockwise from above.
  std::vector<std::uint32_t> outline;
  for (std::size_t n = 0; n + 1 < top.columns; ++n) outline.push_back(index(n, 0));
  for (std::size_t n = 0; n + 1 < top.rows; ++n) outline.push_back(index(top.columns - 1, n));
  for (std::size_t n = top.columns - 1; n > 0; --n) outline.push_back(index(n, top.rows - 1));
  for (std::size_t n = top.rows - 1; n > 0; --n) outline.push_back(index(0, n));
  const auto foot = static_cast<std::uint32_t>(solid.vertices.size());
  for (const std::uint32_t vertex : outline) {
    Eigen::Vector3d below = solid.vertices[vertex];
    below.z() = base_m;
    solid.vertices.push_back(below);
  }
  const auto center = static_cast<std::uint32_t>(solid.vertices.size());
  solid.vertices.emplace_back(0.0, 0.0, base_m);
  const auto count = static_cast<std::uint32_t>(outline.size());
  for (std::uint32_t n = 0; n < count; ++n) {
    const std::uint32_t next = (n + 1) % count;
    solid.triangles.push_back({outline[n], foot + n, foot + next});
    solid.triangles.push_back({outline[n], foot + next, outline[next]});
    solid.triangles.push_back({foot + next, foot + n, center});
  }
  solid.labels.resize(solid.triangles.size(), -1);
  return solid;
}

}  // namespace libmap
