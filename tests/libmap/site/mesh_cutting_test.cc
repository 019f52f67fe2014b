#include "libmap/site/mesh_cutting.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/scenes/mesh_topology.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace mesh_cutting_test {

using Eigen::Vector2d;
using Eigen::Vector3d;
using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::square_mesh;
using graspmap_test::Topology;
using graspmap_test::topology_of;
using graspmap_test::uniform;
using Corners = std::vector<Vector2d>;

double zero(double, double) { return 0.0; }
double waves(double x, double y) { return 0.3 * std::sin(3 * x) * std::cos(4 * y); }

// count x count quads over -half..half, heights by the function.
template <typename Height>
TriangleMesh field_mesh(std::uint32_t count, double half, const Height& height) {
  TriangleMesh mesh;
  for (std::uint32_t j = 0; j <= count; ++j)
    for (std::uint32_t i = 0; i <= count; ++i) {
      const double x = half * (2.0 * i / count - 1);
      const double y = half * (2.0 * j / count - 1);
      mesh.vertices.emplace_back(x, y, height(x, y));
    }
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return j * (count + 1) + i; };
  for (std::uint32_t j = 0; j < count; ++j)
    for (std::uint32_t i = 0; i < count; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

Corners random_star(int count, const Vector2d& center, double least, double most) {
  Corners corners;
  for (int n = 0; n < count; ++n) {
    const double angle = 2 * std::numbers::pi * n / count + 0.1;
    corners.push_back(center + uniform(least, most) * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return corners;
}

// The ball of mesh_samples.h, closed with one vertex at each pole.
TriangleMesh closed_ball(std::uint32_t rows, std::uint32_t columns, const Vector3d& center) {
  TriangleMesh ball = ball_mesh(rows, columns, center);
  std::vector<Triangle> triangles;
  for (Triangle corners : ball.triangles) {
    for (std::uint32_t& v : corners) v = v < columns ? 0 : v >= rows * columns ? rows * columns : v;
    if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0])
      triangles.push_back(corners);
  }
  ball.triangles = triangles;
  return ball;
}

double area_from_above(const TriangleMesh& mesh) {
  double twice = 0;
  for (const Triangle& triangle : mesh.triangles) twice += area_normal(mesh, triangle).z();
  return twice / 2;
}

double smallest_triangle(const TriangleMesh& mesh) {
  double smallest = 1e9;
  for (const Triangle& triangle : mesh.triangles)
    smallest = std::min(smallest, area_normal(mesh, triangle).norm() / 2);
  return smallest;
}

double distance_to_border(const XyPolygon& outline, const Vector3d& vertex) {
  const Corners& corners = outline.corners();
  double nearest = 1e9;
  for (std::size_t n = 0; n < corners.size(); ++n) {
    const Vector2d along = corners[(n + 1) % corners.size()] - corners[n];
    const Vector2d offset = vertex.head<2>() - corners[n];
    const double t = std::clamp(offset.dot(along) / along.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (offset - t * along).norm());
  }
  return nearest;
}

// Edges with exactly one triangle.
std::vector<std::array<std::uint32_t, 2>> open_edges(const TriangleMesh& mesh) {
  std::map<std::array<std::uint32_t, 2>, int> users;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(t[k], t[(k + 1) % 3]);
      ++users[{a, b}];
    }
  std::vector<std::array<std::uint32_t, 2>> open;
  for (const auto& [edge, count] : users)
    if (count == 1) open.push_back(edge);
  return open;
}

// Expects one component without holes whose boundary is the outline.
void expect_clean_cut(const TriangleMesh& mesh, const XyPolygon& outline) {
  mesh.check();
  EXPECT_NEAR(area_from_above(mesh), outline.area_m2(), 1e-9 * (1 + outline.area_m2()));
  const Topology topology = topology_of(mesh.vertices.size(), mesh.triangles);
  EXPECT_EQ(topology.bad_edges, 0U);
  EXPECT_EQ(topology.unused_vertices, 0U);
  EXPECT_EQ(topology.parts, 1U);
  EXPECT_EQ(topology.euler, 1) << "a disc";
  double length = 0;
  double perimeter = 0;
  for (const auto& [a, b] : open_edges(mesh)) {
    ASSERT_LT(distance_to_border(outline, mesh.vertices[a]), 1e-9);
    ASSERT_LT(distance_to_border(outline, mesh.vertices[b]), 1e-9);
    length += (mesh.vertices[a] - mesh.vertices[b]).head<2>().norm();
  }
  const Corners& corners = outline.corners();
  for (std::size_t n = 0; n < corners.size(); ++n)
    perimeter += (corners[(n + 1) % corners.size()] - corners[n]).norm();
  EXPECT_NEAR(length, perimeter, 1e-8 * perimeter);
  EXPECT_GT(smallest_triangle(mesh), 1e-16);
}

TEST(MeshCutting, RectanglesAreExactToTheLastBit) {
  const TriangleMesh mesh = field_mesh(40, 1, waves);
  const XyPolygon outline = make_rectangle({-0.71, -0.333}, {0.123456789, 0.9});
  const TriangleMesh cut = cut_mesh(mesh, {outline});
  expect_clean_cut(cut, outline);
  std::size_t on_border = 0;
  for (const auto& edge : open_edges(cut))
    for (const std::uint32_t v : edge) {
      const Vector3d& p = cut.vertices[v];
      ++on_border;
      ASSERT_TRUE(p.x() == -0.71 || p.x() == 0.123456789 || p.y() == -0.333 || p.y() == 0.9);
    }
  EXPECT_GT(on_border, 100U);
}

TEST(MeshCutting, OutlinesOfAnyForm) {
  const TriangleMesh mesh = field_mesh(30, 2, waves);
  const TriangleMesh coarse = square_mesh(0.5, 2);
  for (const int count : {3, 4, 5, 9, 30, 200})
    for (int round = 0; round < 5; ++round) {
      const XyPolygon outline(random_star(count, {uniform(-0.3, 0.3), 0.1}, 0.2, 1.5));
      expect_clean_cut(cut_mesh(mesh, {outline}), outline);
      expect_clean_cut(cut_mesh(coarse, {outline}), outline);
    }
}

TEST(MeshCutting, OutlineInsideOneTriangle) {
  TriangleMesh mesh;
  mesh.vertices = {{-9, -9, 0}, {9, -9, 18}, {0, 9, 3}};
  mesh.triangles = {{0, 1, 2}};
  const XyPolygon outline(random_star(12, {0, -3}, 0.3, 1.2));
  expect_clean_cut(cut_mesh(mesh, {outline}), outline);
}

TEST(MeshCutting, ThroughVerticesAndAlongEdges) {
  const TriangleMesh mesh = field_mesh(20, 1, waves);  // spacing of 0.1
  const XyPolygon on_grid = make_rectangle({mesh.vertices[3].x(), mesh.vertices[4 * 21].y()},
                                           {mesh.vertices[15].x(), mesh.vertices[17 * 21].y()});
  const TriangleMesh cut = cut_mesh(mesh, {on_grid});
  EXPECT_EQ(cut.triangles.size(), 2U * 12 * 13) << "no triangle is cut";
  EXPECT_EQ(cut.vertices.size(), 13U * 14);
  // A diamond whose sides run along diagonals or through vertices.
  const XyPolygon diamond({{0.5, 0}, {0, 0.5}, {-0.5, 0}, {0, -0.5}});
  expect_clean_cut(cut_mesh(mesh, {diamond}), diamond);
  // Corners on edges, a corner on a vertex, collinear corners.
  const XyPolygon mixed({{-0.5, -0.5}, {0, -0.5}, {0.45, -0.5}, {0.45, 0.3}, {0.1, 0.05}});
  expect_clean_cut(cut_mesh(mesh, {mixed}), mixed);
  // Close enough to vertices that they are moved onto the border.
  const XyPolygon near = make_rectangle({-0.5 + 3e-8, -0.5 - 3e-8}, {0.5, 0.5 + 2e-8});
  const TriangleMesh moved = cut_mesh(mesh, {near});
  expect_clean_cut(moved, near);
  EXPECT_GT(smallest_triangle(moved), 1e-3);
}

TEST(MeshCutting, JaggedHalvesMakeTheWhole) {
  const TriangleMesh mesh = field_mesh(25, 1, waves);
  Corners teeth;
  for (int n = 0; n <= 40; ++n) teeth.emplace_back(0.9 - 1.8 * n / 40, uniform(-0.3, 0.3));
  Corners low = {{-0.9, -0.8}, {0.9, -0.8}};
  low.insert(low.end(), teeth.begin(), teeth.end());
  Corners high = {{0.9, 0.8}, {-0.9, 0.8}};
  high.insert(high.end(), teeth.rbegin(), teeth.rend());
  const double whole = surface_area(cut_mesh(mesh, {make_rectangle({-0.9, -0.8}, {0.9, 0.8})}));
  EXPECT_NEAR(surface_area(cut_mesh(mesh, {XyPolygon(low)})) +
                  surface_area(cut_mesh(mesh, {XyPolygon(high)})),
              whole, 1e-9);
}

TEST(MeshCutting, OverhangsAndClosedBodies) {
  const TriangleMesh ball = closed_ball(40, 60, {0.1, -0.2, 0.3});
  const XyPolygon outline = make_rectangle({-0.4, -0.5}, {0.3, 0.45});
  const TriangleMesh cut = cut_mesh(ball, {outline});
  for (const auto& edge : open_edges(cut))
    for (const std::uint32_t v : edge)
      ASSERT_LT(distance_to_border(outline, cut.vertices[v]), 1e-9);
  EXPECT_NEAR(area_from_above(cut), 0, 1e-12) << "upper and lower side cancel";
  const Topology topology = topology_of(cut.vertices.size(), cut.triangles);
  EXPECT_EQ(topology.parts, 2U);
  EXPECT_EQ(topology.euler, 2);
  // A cap of the sphere between two heights: 2 pi r h.
  ExtrudedPolygon zone;
  zone.min_z = 0.05;
  zone.max_z = 0.8;
  const TriangleMesh fine = cut_mesh(closed_ball(300, 400, {0, 0, 0}), zone);
  EXPECT_NEAR(surface_area(fine), 2 * std::numbers::pi * 0.75, 1e-3);
  for (const auto& edge : open_edges(fine))
    for (const std::uint32_t v : edge)
      ASSERT_TRUE(fine.vertices[v].z() == 0.05 || fine.vertices[v].z() == 0.8);
}

TEST(MeshCutting, UprightWalls) {
  TriangleMesh wall;
  wall.vertices = {{0, 0, 0}, {4, 0, 0}, {4, 0, 2}, {0, 0, 2}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_NEAR(surface_area(cut_mesh(wall, {make_rectangle({1, -1}, {2.5, 1})})), 3, 1e-12);
  EXPECT_NEAR(surface_area(cut_mesh(wall, {make_rectangle({1, 0}, {2.5, 1}), 0.5, 1})), 0.75, 1e-12)
      << "on the border, which belongs to the inside";
  EXPECT_TRUE(cut_mesh(wall, {make_rectangle({1, 0.1}, {2.5, 1})}).triangles.empty());
  // Through a corner of the outline.
  const TriangleMesh turned = cut_mesh(wall, {XyPolygon({{2, -1}, {3, 0}, {2, 1}, {1, 0}})});
  EXPECT_NEAR(surface_area(turned), 4, 1e-12);
  // Half a ball, cut along a meridian.
  const TriangleMesh ball = closed_ball(12, 12, {0, 0, 0});
  EXPECT_NEAR(surface_area(cut_mesh(ball, {make_rectangle({0, -2}, {2, 2})})) * 2,
              surface_area(ball), 1e-9);
}

TEST(MeshCutting, SurfacesThatAreNoManifold) {
  TriangleMesh mesh = field_mesh(10, 1, zero);
  const TriangleMesh upright = [] {
    TriangleMesh fin;
    fin.vertices = {{-1, 0, 0}, {1, 0, 0}, {0, 0, 1}};
    fin.triangles = {{0, 1, 2}};
    return fin;
  }();
  mesh = graspmap_test::join_meshes(mesh, upright);
  mesh.triangles.push_back(mesh.triangles[55]);  // duplicate
  mesh.triangles.push_back({7, 7, 9});           // degenerate
  const TriangleMesh cut = cut_mesh(mesh, {make_rectangle({-0.33, -0.47}, {0.51, 0.6})});
  EXPECT_GT(cut.triangles.size(), 20U);
  EXPECT_NEAR(surface_area(cut), 0.84 * 1.07 + (0.84 - 0.33 * 0.33 / 2 - 0.51 * 0.51 / 2), 0.02);
}

TEST(MeshCutting, AllThatBelongsToItIsCarriedAlong) {
  TriangleMesh mesh = field_mesh(12, 1, zero);
  ScalarField linear{"linear", ScalarType::float64, {}};
  ScalarField whole{"whole", ScalarType::uint8, {}};
  for (const Vector3d& p : mesh.vertices) {
    linear.values.push_back(2 * p.x() - 3 * p.y() + 1);
    whole.values.push_back(p.x() > 0 ? 1 : 0);
    mesh.vertex_normals.emplace_back(0, 0, 1);
    mesh.vertex_colors.push_back({static_cast<std::uint8_t>(std::lround(100 + 100 * p.x())), 7, 9});
  }
  mesh.vertex_fields = {linear, whole};
  ScalarField faces{"id", ScalarType::int32, {}};
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n)
    faces.values.push_back(static_cast<double>(n));
  mesh.face_fields = {faces};
  const TriangleMesh cut = cut_mesh(mesh, {XyPolygon(random_star(9, {0, 0}, 0.3, 0.9))});
  cut.check();
  ASSERT_EQ(cut.vertex_fields.size(), 2U);
  ASSERT_EQ(cut.face_fields.size(), 1U);
  EXPECT_EQ(cut.face_fields[0].type, ScalarType::int32);
  for (std::size_t v = 0; v < cut.vertices.size(); ++v) {
    const Vector3d& p = cut.vertices[v];
    ASSERT_NEAR(cut.vertex_fields[0].values[v], 2 * p.x() - 3 * p.y() + 1, 1e-12);
    const double value = cut.vertex_fields[1].values[v];
    ASSERT_TRUE(value == 0 || value == 1);
    ASSERT_NEAR(cut.vertex_colors[v][0], 100 + 100 * p.x(), 1.51);
    ASSERT_EQ(cut.vertex_colors[v][1], 7);
    ASSERT_EQ(cut.vertex_normals[v].z(), 1);
  }
  for (std::size_t t = 0; t < cut.triangles.size(); ++t) {
    Vector3d middle = Vector3d::Zero();
    for (const std::uint32_t v : cut.triangles[t]) middle += cut.vertices[v] / 3;
    const Triangle& source = mesh.triangles[static_cast<std::size_t>(cut.face_fields[0].values[t])];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d& a = mesh.vertices[source[k]];
      ASSERT_GT((mesh.vertices[source[(k + 1) % 3]] - a).cross(middle - a).z(), 0)
          << "it is a part of the triangle that its field names";
    }
  }
}

TEST(MeshCutting, FarFromTheOrigin) {
  const Vector3d far(500000, -4200000, 100);
  TriangleMesh mesh = field_mesh(20, 1, waves);
  for (Vector3d& vertex : mesh.vertices) vertex += far;
  Corners corners = random_star(11, {0, 0}, 0.3, 0.9);
  for (Vector2d& corner : corners) corner += far.head<2>();
  const XyPolygon outline(corners);
  const TriangleMesh cut = cut_mesh(mesh, {outline});
  EXPECT_NEAR(area_from_above(cut), outline.area_m2(), 1e-7);
  const Topology topology = topology_of(cut.vertices.size(), cut.triangles);
  EXPECT_EQ(topology.parts, 1U);
  EXPECT_EQ(topology.euler, 1);
  EXPECT_EQ(topology.bad_edges, 0U);
}

TEST(MeshCutting, AllOrNothing) {
  const TriangleMesh mesh = field_mesh(8, 1, waves);
  const TriangleMesh all = cut_mesh(mesh, {make_rectangle({-2, -2}, {2, 2}), -9, 9});
  EXPECT_EQ(all.vertices, mesh.vertices);
  EXPECT_EQ(all.triangles, mesh.triangles);
  EXPECT_EQ(cut_mesh(mesh, {}).triangles, mesh.triangles);
  EXPECT_EQ(cut_mesh(mesh, {make_rectangle({-1, -1}, {1, 1})}).triangles, mesh.triangles)
      << "exactly its border";
  EXPECT_TRUE(cut_mesh(mesh, {make_rectangle({3, 3}, {4, 4})}).triangles.empty());
  EXPECT_TRUE(cut_mesh({}, {make_rectangle({3, 3}, {4, 4})}).triangles.empty());
  TriangleMesh broken = mesh;
  broken.vertices[20].y() = std::numeric_limits<double>::quiet_NaN();
  const Error error = error_of([&] { cut_mesh(broken, {}); });
  EXPECT_EQ(error.context().field, "vertex 20");
  broken = mesh;
  broken.triangles[3][1] = 1000;
  EXPECT_TRUE(
      graspmap_test::is_error(error_of([&] { cut_mesh(broken, {}); }),
                              {.field = "vertex of triangle 3", .value = "1000", .bound = "< 81"}));
}

TEST(MeshCutting, ThreadsMakeNoDifference) {
  const TriangleMesh mesh = field_mesh(80, 1, waves);
  const XyPolygon outline(random_star(40, {0, 0}, 0.2, 0.9));
  const ThreadLimit one(1);
  const TriangleMesh a = cut_mesh(mesh, {outline});
  const ThreadLimit more(5);
  const TriangleMesh b = cut_mesh(mesh, {outline});
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
}

}  // namespace mesh_cutting_test
}  // namespace libmap
