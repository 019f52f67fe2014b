#include "libmap/world/height_field.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/world/collision_balls.h"
#include "libmap/world/world_visuals.h"
#include "tests/libmap/world/world_samples.h"
#include "tests/support/test_support.h"

namespace height_field_test {

using namespace graspmap_test;
using libmap::HeightField;
using libmap::TriangleMesh;

Eigen::Vector3d node(const HeightField& field, std::size_t column, std::size_t row) {
  return {field.corner_m.x() + static_cast<double>(column) * field.cell_size_m,
          field.corner_m.y() + static_cast<double>(row) * field.cell_size_m,
          field.base_m + static_cast<double>(field.heights_m[row * field.columns + column])};
}

// The cells that are not left out and within `half_m`, as triangles.
TriangleMesh mesh_of(const HeightField& field, double half_m) {
  TriangleMesh mesh;
  for (std::size_t row = 0; row + 1 < field.rows; ++row)
    for (std::size_t column = 0; column + 1 < field.columns; ++column) {
      if (field.is_missing[row * (field.columns - 1) + column]) continue;
      if (node(field, column, row).head<2>().minCoeff() < -half_m ||
          node(field, column + 1, row + 1).head<2>().maxCoeff() > half_m)
        continue;
      const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
      for (const auto& [x, y] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}})
        mesh.vertices.push_back(
            node(field, column + static_cast<std::size_t>(x), row + static_cast<std::size_t>(y)));
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
    }
  return mesh;
}

double farthest(const TriangleMesh& from, const TriangleMesh& to) {
  std::vector<Eigen::Vector3d> points;
  for (const libmap::SurfacePoint& point : libmap::sample_surface(from, 2e5, 1))
    points.push_back(point.position);
  const std::vector<double> distances = libmap::distances_to_surface(points, to);
  return *std::max_element(distances.begin(), distances.end());
}

TEST(HeightField, OfAPlaneIsThePlane) {
  TriangleMesh mesh = square_mesh(0.0, 0.5);
  for (Eigen::Vector3d& v : mesh.vertices) v.z() = 1000.0 + 0.4 * v.x() - 0.7 * v.y();
  const HeightField field = libmap::make_height_field(mesh, {.cell_size_m = 0.03});
  EXPECT_EQ(libmap::count_of(field.is_missing), 0U);
  EXPECT_LT(field.deviation_m, 1e-6);
  std::size_t nodes = 0;
  for (std::size_t row = 0; row < field.rows; ++row)
    for (std::size_t column = 0; column < field.columns; ++column) {
      const Eigen::Vector3d at = node(field, column, row);
      if (at.head<2>().cwiseAbs().maxCoeff() > 0.5) continue;
      ++nodes;
      EXPECT_NEAR(at.z(), 1000.0 + 0.4 * at.x() - 0.7 * at.y(), 1e-6) << at.transpose();
    }
  EXPECT_EQ(nodes, 33U * 33U);
}

// The stated deviation against distances by Embree, in both directions.
TEST(HeightField, NoPointIsFartherThanItsDeviation) {
  for (const double cell : {0.004, 0.015, 0.04}) {
    const TriangleMesh ground = wavy_ground();
    const HeightField field =
        libmap::make_height_field(ground, {.cell_size_m = cell, .max_deviation_m = 1.0});
    EXPECT_EQ(libmap::count_of(field.is_missing), 0U);
    EXPECT_GT(field.deviation_m, 1e-6);
    const double there = farthest(mesh_of(field, 0.4), ground);
    const double back = farthest(ground, mesh_of(field, 1.0));
    EXPECT_LE(std::max(there, back), field.deviation_m + 1e-6) << cell;
    EXPECT_GE(std::max(there, back), 0.3 * field.deviation_m) << cell;
  }
}

TEST(HeightField, LeavesOutOverhangs) {
  const TriangleMesh mesh = ground_with_boulder();
  const HeightField field = libmap::make_height_field(mesh, {});
  EXPECT_LE(field.deviation_m, 0.002);
  EXPECT_LE(farthest(mesh_of(field, 0.4), mesh), field.deviation_m + 1e-6);
  double missing_m2 = 0.0;
  for (std::size_t row = 0; row + 1 < field.rows; ++row)
    for (std::size_t column = 0; column + 1 < field.columns; ++column) {
      const bool is_missing = field.is_missing[row * (field.columns - 1) + column];
      if (is_missing) missing_m2 += field.cell_size_m * field.cell_size_m;
      const Eigen::Vector2d at = node(field, column, row).head<2>();
      EXPECT_TRUE(is_missing || (at - Eigen::Vector2d(0.1, 0.05)).norm() > 0.11);
      EXPECT_LE(node(field, column, row).z(),
                wavy_height(at.x(), at.y()) + 0.002);  // no node is above the ground
    }
  EXPECT_NEAR(missing_m2, 3.1416 * 0.127 * 0.127, 0.01);
}

TEST(HeightField, BadMeshes) {
  TriangleMesh ceiling = square_mesh(0.0);
  for (libmap::Triangle& t : ceiling.triangles) std::swap(t[0], t[1]);
  EXPECT_TRUE(is_error(error_of([&] { libmap::make_height_field(ceiling, {}); }),
                       {.field = "triangles of the mesh"}));
  const libmap::Error error =
      error_of([] { libmap::make_height_field(square_mesh(0.0, 1e3), {.cell_size_m = 1e-3}); });
  EXPECT_EQ(error.context().field, "cell_size_m");
}

// Distance of points outside of all balls from the nearest one, at most.
double farthest_outside(const std::vector<libmap::CollisionBall>& balls, const TriangleMesh& mesh) {
  double farthest = 0.0;
  std::vector<Eigen::Vector3d> points = mesh.vertices;
  for (const libmap::SurfacePoint& point : libmap::sample_surface(mesh, 2e4, 1))
    points.push_back(point.position);
  for (const Eigen::Vector3d& point : points) {
    double nearest = 1e9;
    for (const libmap::CollisionBall& ball : balls)
      nearest = std::min(nearest, (ball.center - point).norm() - ball.radius_m);
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

// A sphere is its own balls' closed form: each is inside of it up to the bound.
TEST(CollisionBalls, CoverASphere) {
  const Eigen::Vector3d middle(1.0, 2.0, 3.0);
  const TriangleMesh sphere = ball_mesh(32, 64, middle, 0.2);
  const std::vector<bool> marks(sphere.triangles.size(), true);
  for (const double bound_m : {0.002, 0.01}) {
    const auto balls = libmap::cover_with_balls(sphere, marks, sphere,
                                                {.max_radius_m = 0.05, .max_deviation_m = bound_m});
    for (const libmap::CollisionBall& ball : balls) {
      EXPECT_LE((ball.center - middle).norm() + ball.radius_m, 0.2 + bound_m);
      EXPECT_LE(ball.radius_m, 0.05 + 2 * bound_m);
    }
    EXPECT_LE(farthest_outside(balls, sphere), bound_m);
    EXPECT_LE(balls.size(), sphere.triangles.size() / 2);
  }
}

// Large triangles are divided, and only marked ones are covered.
TEST(CollisionBalls, CoverMarkedTrianglesOnly) {
  const TriangleMesh square = square_mesh(0.5, 0.3);
  const libmap::CollisionBallOptions options{.max_radius_m = 0.05, .max_deviation_m = 0.001};
  EXPECT_TRUE(libmap::cover_with_balls(square, {false, false}, square, options).empty());
  const auto half = libmap::cover_with_balls(square, {true, false}, square, options);
  const auto whole = libmap::cover_with_balls(square, {true, true}, square, options);
  EXPECT_GT(half.size(), 50U);
  EXPECT_GT(whole.size(), half.size());
  EXPECT_LE(farthest_outside(whole, square), 0.001);
  for (const libmap::CollisionBall& ball : whole)
    EXPECT_LE(ball.center.z() + ball.radius_m, 0.501 + 1e-9);
}

// Two faces of a thin wall: no ball reaches beyond the other face by more than the bound.
TEST(CollisionBalls, StayInsideThinWalls) {
  TriangleMesh back = square_mesh(0.0, 0.1);
  for (libmap::Triangle& t : back.triangles) std::swap(t[0], t[1]);
  const TriangleMesh wall = join_meshes(square_mesh(0.004, 0.1), back);
  const auto balls = libmap::cover_with_balls(wall, {true, true, true, true}, wall,
                                              {.max_radius_m = 0.05, .max_deviation_m = 0.001});
  EXPECT_LE(farthest_outside(balls, wall), 0.001);
  for (const libmap::CollisionBall& ball : balls) {
    EXPECT_LE(ball.center.z() + ball.radius_m, 0.005 + 1e-9);
    EXPECT_GE(ball.center.z() - ball.radius_m, -0.001 - 1e-9);
  }
}

// Bilinear interpolation in the texture is linear interpolation between the vertices.
TEST(WorldVisuals, BakedColorsAreThoseOfTheVertices) {
  TriangleMesh mesh = wavy_ground(0.1);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    mesh.vertex_colors.push_back(
        {static_cast<std::uint8_t>(100 + v % 50), static_cast<std::uint8_t>(120 - v % 30), 90});
  const libmap::TexturedMesh baked = libmap::bake_vertex_colors(mesh);
  ASSERT_EQ(baked.pages.size(), 1U);
  baked.check();
  const libmap::ColorImage& page = baked.pages[0];
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const double u = uniform(0.0, 0.5);
    const double v = uniform(0.0, 0.5);
    const auto& corners = baked.texture_coordinates[t];
    const Eigen::Vector2d at = ((1 - u - v) * corners[0].cast<double>() +
                                u * corners[1].cast<double>() + v * corners[2].cast<double>()) *
                                   page.width -
                               Eigen::Vector2d(0.5, 0.5);
    const int x = static_cast<int>(at.x() + 1e-3);
    const int y = static_cast<int>(at.y() + 1e-3);
    const double fx = at.x() - x;
    const double fy = at.y() - y;
    const auto texel = [&](int dx, int dy) {
      return static_cast<double>(page.pixels[page.index(std::min(x + dx, page.width - 1),
                                                        std::min(y + dy, page.height - 1))][0]);
    };
    const double found = (1 - fx) * ((1 - fy) * texel(0, 0) + fy * texel(0, 1)) +
                         fx * ((1 - fy) * texel(1, 0) + fy * texel(1, 1));
    const auto color = [&](int k) {
      return static_cast<double>(
          mesh.vertex_colors[mesh.triangles[t][static_cast<std::size_t>(k)]][0]);
    };
    EXPECT_NEAR(found, (1 - u - v) * color(0) + u * color(1) + v * color(2), 0.02);
  }
}

}  // namespace height_field_test
