#include "libmap/core/triangle_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "libmap/core/pose.h"
#include "tests/support/test_support.h"

namespace triangle_mesh_test {

using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::TriangleMesh;

// Box from the origin to `size`; faces are counter-clockwise from outside.
TriangleMesh box(const Vector3d& size) {
  TriangleMesh mesh;
  for (const double z : {0.0, size.z()})
    for (const double y : {0.0, size.y()})
      for (const double x : {0.0, size.x()}) mesh.vertices.emplace_back(x, y, z);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// Sphere about the origin with `rings` rings of latitude.
TriangleMesh sphere(double radius, std::uint32_t rings) {
  TriangleMesh mesh;
  const std::uint32_t columns = 2 * rings;
  for (std::uint32_t r = 0; r <= rings; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const double polar = std::numbers::pi * r / rings;
      const double azimuth = 2 * std::numbers::pi * c / columns;
      mesh.vertices.emplace_back(radius * std::sin(polar) * std::cos(azimuth),
                                 radius * std::sin(polar) * std::sin(azimuth),
                                 radius * std::cos(polar));
    }
  for (std::uint32_t r = 0; r < rings; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const std::uint32_t a = r * columns + c;
      const std::uint32_t b = r * columns + (c + 1) % columns;
      if (r > 0) mesh.triangles.push_back({a, a + columns, b});
      if (r + 1 < rings) mesh.triangles.push_back({b, a + columns, b + columns});
    }
  return mesh;
}

TEST(TriangleMeshTest, BoxHasItsAreaAndVolume) {
  const TriangleMesh mesh = box({2, 3, 5});
  EXPECT_NEAR(libmap::surface_area(mesh), 2 * (6 + 10 + 15), 1e-12);
  EXPECT_NEAR(libmap::signed_volume(mesh), 30, 1e-12);
}

TEST(TriangleMeshTest, TurnedInsideOutTheVolumeIsNegative) {
  TriangleMesh mesh = box({2, 3, 5});
  for (libmap::Triangle& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(libmap::signed_volume(mesh), -30, 1e-12);
  EXPECT_NEAR(libmap::surface_area(mesh), 62, 1e-12);
}

TEST(TriangleMeshTest, AreaAndVolumeDoNotMove) {
  TriangleMesh mesh = box({0.2, 0.3, 0.5});
  const libmap::Pose pose = libmap::make_pose_from_rpy({1e6, -2e6, 3e5}, {11, 22, 33});
  for (Vector3d& vertex : mesh.vertices) vertex = pose * vertex;
  EXPECT_NEAR(libmap::surface_area(mesh), 0.62, 1e-7);
  EXPECT_NEAR(libmap::signed_volume(mesh), 0.03, 1e-8) << "also far from the origin";
}

TEST(TriangleMeshTest, FineSphereComesNearTheClosedForm) {
  const TriangleMesh mesh = sphere(0.5, 100);
  EXPECT_NEAR(libmap::surface_area(mesh), std::numbers::pi, 2e-3);
  EXPECT_NEAR(libmap::signed_volume(mesh), std::numbers::pi / 6, 1e-3);
}

TEST(TriangleMeshTest, AreaNormalPointsOutAndIsTwiceTheArea) {
  const TriangleMesh mesh = box({2, 3, 5});
  for (const libmap::Triangle& triangle : mesh.triangles) {
    const Vector3d center =
        (mesh.vertices[triangle[0]] + mesh.vertices[triangle[1]] + mesh.vertices[triangle[2]]) / 3;
    EXPECT_GT(libmap::area_normal(mesh, triangle).dot(center - Vector3d(1, 1.5, 2.5)), 0);
  }
  EXPECT_EQ(libmap::area_normal(mesh, {4, 5, 6}), Vector3d(0, 0, 6));
}

TEST(TriangleMeshTest, VertexNormalsOfASphereAreRadial) {
  const TriangleMesh mesh = sphere(2.0, 40);
  const std::vector<Eigen::Vector3f> normals = libmap::estimate_vertex_normals(mesh);
  ASSERT_EQ(normals.size(), mesh.vertices.size());
  // Each pole has many vertices, each with the triangles of one column only.
  for (std::size_t n = 80; n + 80 < normals.size(); ++n) {
    EXPECT_NEAR(normals[n].norm(), 1.0F, 1e-5F);
    EXPECT_GT(normals[n].cast<double>().dot(mesh.vertices[n].normalized()), 0.998);
  }
}

TEST(TriangleMeshTest, LooseVertexHasNoNormal) {
  TriangleMesh mesh = box({1, 1, 1});
  mesh.vertices.emplace_back(9, 9, 9);
  EXPECT_EQ(libmap::estimate_vertex_normals(mesh).back(), Eigen::Vector3f(0, 0, 0));
}

TEST(TriangleMeshTest, NothingHasNoAreaAndNoVolume) {
  EXPECT_EQ(libmap::surface_area({}), 0);
  EXPECT_EQ(libmap::signed_volume({}), 0);
  TriangleMesh{}.check();
}

TEST(TriangleMeshTest, CheckNamesWhatIsWrong) {
  TriangleMesh mesh = box({1, 1, 1});
  mesh.check();
  mesh.triangles[3][2] = 8;
  EXPECT_EQ(error_of([&] { mesh.check(); }).context().field, "vertex of triangle 3");
  EXPECT_EQ(error_of([&] { mesh.check(); }).context().bound, "< 8");
  mesh = box({1, 1, 1});
  mesh.vertex_normals.resize(7);
  EXPECT_EQ(error_of([&] { mesh.check(); }).context().field, "vertex normals");
  mesh = box({1, 1, 1});
  mesh.vertex_colors.resize(9);
  EXPECT_EQ(error_of([&] { mesh.check(); }).context().field, "vertex colors");
  mesh = box({1, 1, 1});
  mesh.face_fields.push_back({"id", libmap::ScalarType::int32, std::vector<double>(8)});
  EXPECT_EQ(error_of([&] { mesh.check(); }).context().field, "id");
}

TEST(TexturedMeshTest, CoordinatesThatAreNotFinite) {
  libmap::TexturedMesh model;
  model.mesh = box({1, 1, 1});
  model.texture_coordinates.assign(
      12, {Eigen::Vector2f(0, 0), Eigen::Vector2f(1, 0), Eigen::Vector2f(0, 1)});
  model.page_of_triangle.assign(12, libmap::no_page);
  model.check();
  model.texture_coordinates[7][2].y() = std::nanf("");
  const libmap::Error error = error_of([&] { model.check(); });
  EXPECT_TRUE(is_error(error, {.field = "triangle 7"}));
  EXPECT_EQ(error.context().field, "triangle 7");
}

}  // namespace triangle_mesh_test
