#include "libmap/mesh/mesh_parts.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace mesh_parts_test {

using graspmap_test::ball_mesh;
using graspmap_test::cubes_mesh;
using graspmap_test::error_of;
using graspmap_test::square_mesh;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;

// A ball whose values are linear functions of the position, so that interpolation is exact.
double linear(const Eigen::Vector3d& p) { return 3 * p.x() - 2 * p.y() + 5 * p.z(); }

TriangleMesh valued_ball() {
  TriangleMesh mesh = ball_mesh(8, 12, {0.5, -0.25, 2.0});
  ScalarField& real = mesh.vertex_fields.emplace_back();
  real.name = "height";
  real.type = ScalarType::float64;
  ScalarField whole{"views", ScalarType::int32, {}};
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d& p = mesh.vertices[v];
    real.values.push_back(linear(p));
    whole.values.push_back(static_cast<double>(v));
    mesh.vertex_normals.emplace_back((p - Eigen::Vector3d(0.5, -0.25, 2)).cast<float>());
    const auto shade = static_cast<std::uint8_t>(std::lround(100 + 20 * p.z()));
    mesh.vertex_colors.push_back({shade, 7, static_cast<std::uint8_t>(255 - shade)});
  }
  mesh.vertex_fields.push_back(std::move(whole));
  ScalarField number{"number", ScalarType::uint32, std::vector<double>(mesh.triangles.size())};
  std::iota(number.values.begin(), number.values.end(), 0.0);
  mesh.face_fields.push_back(std::move(number));
  return mesh;
}

TEST(MeshParts, SelectedTrianglesKeepAllThatBelongsToThem) {
  const TriangleMesh mesh = valued_ball();
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = t % 7 == 3 || t > 150;
  const TriangleMesh part = select_triangles(mesh, keep);
  part.check();
  ASSERT_EQ(part.triangles.size(),
            static_cast<std::size_t>(std::count(keep.begin(), keep.end(), true)));
  std::vector<bool> used(part.vertices.size());
  for (std::size_t t = 0; t < part.triangles.size(); ++t) {
    const auto source = static_cast<std::size_t>(part.face_fields[0].values[t]);
    EXPECT_TRUE(keep[source]);

    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = mesh.triangles[source][k];
      const std::uint32_t to = part.triangles[t][k];
      used[to] = true;
      EXPECT_EQ(part.vertices[to], mesh.vertices[from]);
      EXPECT_EQ(part.vertex_normals[to], mesh.vertex_normals[from]);
      EXPECT_EQ(part.vertex_colors[to], mesh.vertex_colors[from]);
      EXPECT_EQ(part.vertex_fields[1].values[to], from);
    }
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0) << "vertices of no triangle are left";
  EXPECT_TRUE(std::is_sorted(part.face_fields[0].values.begin(), part.face_fields[0].values.end()));
  EXPECT_TRUE(
      std::is_sorted(part.vertex_fields[1].values.begin(), part.vertex_fields[1].values.end()));
}

TEST(MeshParts, SelectingNothingAndAllAndTheWrongNumber) {
  const TriangleMesh mesh = valued_ball();
  const TriangleMesh none = select_triangles(mesh, std::vector<bool>(mesh.triangles.size()));
  EXPECT_TRUE(none.triangles.empty());
  EXPECT_TRUE(none.vertices.empty());
  EXPECT_EQ(none.face_fields.size(), 1U);
  const TriangleMesh all = select_triangles(mesh, std::vector<bool>(mesh.triangles.size(), true));
  EXPECT_EQ(all.triangles, mesh.triangles);
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] {
                                        select_triangles(mesh, {true, false});
                                      }),
                                      {.field = "number of marks of triangles", .value = "2"}));
}

TEST(MeshParts, ComponentsByEdgesNotByCorners) {
  TriangleMesh mesh = square_mesh(0.0);
  // A third triangle touches the square in a corner only, a fourth shares an edge with the third.
  mesh.vertices.insert(mesh.vertices.end(), {{2, 1, 0}, {2, 2, 0}, {1, 2, 0}});
  mesh.triangles.push_back({2, 4, 5});
  mesh.triangles.push_back({2, 5, 6});
  const MeshComponents components = connected_components(mesh);
  EXPECT_EQ(components.of_triangle, (std::vector<std::uint32_t>{0, 0, 1, 1}));
  ASSERT_EQ(components.areas_m2.size(), 2U);
  EXPECT_DOUBLE_EQ(components.areas_m2[0], 4.0);
  EXPECT_DOUBLE_EQ(components.areas_m2[1], 1.0);
  EXPECT_TRUE(connected_components(TriangleMesh{}).areas_m2.empty());
}

TriangleMesh with_gaps(const TriangleMesh& mesh) {
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = uniform(0, 1) < 0.6;
  return select_triangles(mesh, keep);
}

void expect_those_of_a_hash_table(const TriangleMesh& mesh, std::size_t least) {
  const MeshComponents truth = connected_components(mesh);
  const MeshComponents found = connected_components(mesh, opposites_of(mesh));
  EXPECT_GE(truth.areas_m2.size(), least);
  EXPECT_EQ(found.of_triangle, truth.of_triangle);
  EXPECT_EQ(found.areas_m2, truth.areas_m2);
}

TEST(MeshParts, ComponentsByHalfEdgesAreThoseByEdges) {
  expect_those_of_a_hash_table({}, 0);
  expect_those_of_a_hash_table(
      with_gaps(terrain_mesh(40, 1.0, [](double x, double y) { return x * y; })), 20);
}

TEST(MeshParts, EdgesOfComponentsMayHaveManyTriangles) {
  // Two pairs of cubes with a common edge, and a triangle with a repeated vertex.
  TriangleMesh mesh = cubes_mesh({{0, 0, 0}, {1, 1, 0}, {5, 0, 0}, {6, 1, 0}});
  mesh.triangles.push_back({0, 0, 1});
  expect_those_of_a_hash_table(mesh, 2);
  mesh.triangles.pop_back();
  expect_those_of_a_hash_table(mesh, 2);
}

TEST(MeshParts, ComponentsDoNotDependOnHowTrianglesAreOrdered) {
  TriangleMesh mesh =
      graspmap_test::join_meshes(ball_mesh(9, 14, {0, 0, 0}), ball_mesh(5, 9, {9, 0, 0}));
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), graspmap_test::random_engine());
  const MeshComponents components = connected_components(mesh);
  ASSERT_EQ(components.areas_m2.size(), 2U);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const bool is_far = mesh.vertices[mesh.triangles[t][0]].x() > 4;
    const bool first_is_far = mesh.vertices[mesh.triangles[0][0]].x() > 4;
    EXPECT_EQ(components.of_triangle[t], is_far == first_is_far ? 0U : 1U);
  }
  EXPECT_NEAR(components.areas_m2[0] + components.areas_m2[1], surface_area(mesh), 1e-12);
}

TEST(MeshParts, VertexBetweenTwo) {
  TriangleMesh mesh = valued_ball();
  const std::size_t before = mesh.vertices.size();
  const std::uint32_t a = 17;
  const std::uint32_t b = 44;
  const std::uint32_t added = append_vertex_between(mesh, a, b, 0.25);
  mesh.check();
  EXPECT_EQ(added, before);
  EXPECT_LT((mesh.vertices[added] - (0.75 * mesh.vertices[a] + 0.25 * mesh.vertices[b])).norm(),
            1e-15);
  EXPECT_NEAR(mesh.vertex_normals[added].norm(), 1.0F, 1e-6F);
  EXPECT_NEAR(mesh.vertex_fields[0].values[added], linear(mesh.vertices[added]), 1e-12);
  EXPECT_EQ(mesh.vertex_fields[1].values[added], a) << "whole numbers take the nearer end's";
  EXPECT_NEAR(mesh.vertex_colors[added][0],
              0.75 * mesh.vertex_colors[a][0] + 0.25 * mesh.vertex_colors[b][0], 0.51);
  const std::uint32_t end = append_vertex_between(mesh, a, b, 1.0);
  EXPECT_EQ(mesh.vertices[end], mesh.vertices[b]);
  EXPECT_EQ(mesh.vertex_fields[1].values[end], b);
}

TEST(MeshParts, PointsOnTheSurfaceInterpolateEveryValue) {
  const TriangleMesh mesh = valued_ball();
  std::vector<TrianglePoint> points;
  for (int n = 0; n < 300; ++n) {
    double u = uniform(0, 1);
    double v = uniform(0, 1);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    points.push_back(
        {static_cast<std::uint32_t>(uniform(0, 0.999) * static_cast<double>(mesh.triangles.size())),
         u, v});
  }
  const PointCloud cloud = points_on_surface(mesh, points);
  cloud.check();
  ASSERT_EQ(cloud.size(), points.size());
  for (std::size_t n = 0; n < points.size(); ++n) {
    EXPECT_EQ(cloud.positions[n], position_on(mesh, points[n]));
    EXPECT_NEAR(cloud.find_field("height")->values[n], linear(cloud.positions[n]), 1e-12);
    EXPECT_EQ(cloud.find_field("number")->values[n], points[n].triangle);
    EXPECT_NEAR(cloud.normals[n].norm(), 1.0F, 1e-6F);
    const Eigen::Vector3d outward = cloud.positions[n] - Eigen::Vector3d(0.5, -0.25, 2);
    EXPECT_GT(cloud.normals[n].cast<double>().dot(outward.normalized()), 0.9);
    const Triangle& corners = mesh.triangles[points[n].triangle];
    const double views = cloud.find_field("views")->values[n];
    EXPECT_TRUE(views == corners[0] || views == corners[1] || views == corners[2]);
  }
}

TEST(MeshParts, CornersAreTheVertices) {
  const TriangleMesh mesh = valued_ball();
  const std::uint32_t t = 100;
  const PointCloud cloud = points_on_surface(mesh, {{t, 0, 0}, {t, 1, 0}, {t, 0, 1}});
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(cloud.positions[k], mesh.vertices[mesh.triangles[t][k]]);
    EXPECT_EQ(cloud.colors[k], mesh.vertex_colors[mesh.triangles[t][k]]);
  }
}

TEST(MeshParts, ValuesThatAreNotFiniteStayWhereTheyHaveNoWeight) {
  TriangleMesh mesh = square_mesh(0.0);
  mesh.vertex_fields.push_back({"error", ScalarType::float32, {1, 2, 3, std::nan("")}});
  const PointCloud cloud = points_on_surface(mesh, {{1, 0.5, 0.0}, {1, 0.25, 0.25}});
  EXPECT_EQ(cloud.fields[0].values[0], 2.0);
  EXPECT_TRUE(std::isnan(cloud.fields[0].values[1]));
}

TEST(MeshParts, WithoutVertexNormalsTheTrianglesOwn) {
  const PointCloud cloud = points_on_surface(square_mesh(0.5), {{0, 0.2, 0.2}, {1, 0.1, 0.8}});
  for (const Eigen::Vector3f& normal : cloud.normals) EXPECT_EQ(normal, Eigen::Vector3f::UnitZ());
  EXPECT_TRUE(cloud.colors.empty());
}

TEST(MeshParts, MovedThereAndBack) {
  const TriangleMesh mesh = valued_ball();
  const Pose pose = make_pose_from_rpy({10, -4, 1}, {20, -50, 130});
  const TriangleMesh moved = transform_mesh(mesh, pose);
  EXPECT_NEAR(surface_area(moved), surface_area(mesh), 1e-12);
  const TriangleMesh back = transform_mesh(moved, pose.inverse());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    EXPECT_LT((moved.vertices[v] - pose * mesh.vertices[v]).norm(), 1e-14);
    EXPECT_LT((back.vertices[v] - mesh.vertices[v]).norm(), 1e-13);
    EXPECT_LT((back.vertex_normals[v] - mesh.vertex_normals[v]).norm(), 1e-5F);
  }
  EXPECT_EQ(moved.face_fields, mesh.face_fields);
}

}  // namespace mesh_parts_test
}  // namespace libmap
