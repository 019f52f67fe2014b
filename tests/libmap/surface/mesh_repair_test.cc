// Repair of defective triangles: duplicate, degenerate, misoriented, non-manifold or intersecting.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/surface/mesh_report.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/surface/cleaning_checks.h"
#include "tests/support/test_support.h"

namespace mesh_repair_test {

using graspmap_test::cleaned;
using graspmap_test::cubes_mesh;
using graspmap_test::geodesic_mesh;
using graspmap_test::mesh_of;
using graspmap_test::repairs;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;
using graspmap_test::with_values;
using libmap::clean_mesh;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::MeshReport;
using libmap::report_mesh;
using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;

TEST(MeshRepair, TriangleSoupIsWelded) {
  const TriangleMesh ball = with_values(geodesic_mesh(3, 1.0));
  TriangleMesh soup;
  soup.vertex_fields = {{"height", libmap::ScalarType::float64, {}}};
  for (const libmap::Triangle& t : ball.triangles) {
    const auto n = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t v : t) {
      soup.vertices.push_back(ball.vertices[v] + 1e-9 * Eigen::Vector3d(uniform(-1, 1), 0, 0));
      soup.vertex_colors.push_back(ball.vertex_colors[v]);
      soup.vertex_fields[0].values.push_back(ball.vertex_fields[0].values[v]);
    }
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  const MeshCleaningResult result = cleaned(soup, repairs());
  EXPECT_EQ(result.mesh.vertices.size(), ball.vertices.size());
  EXPECT_EQ(result.merged_vertices, soup.vertices.size() - ball.vertices.size());
  EXPECT_TRUE(report_mesh(result.mesh).is_watertight());
  for (std::size_t v = 0; v < result.mesh.vertices.size(); ++v)
    EXPECT_NEAR(result.mesh.vertex_fields[0].values[v],
                result.mesh.vertices[v].z() + 2 * result.mesh.vertices[v].x(), 1e-8);
}

TEST(MeshRepair, MergeDistance) {
  MeshCleaningOptions options = repairs();
  options.merge_distance_m = 0.1;
  // Along a line, each within 0.1 of its predecessor: the third is too far from the first, into
  // which the second is merged.
  const TriangleMesh mesh =
      mesh_of({{0, 0, 0}, {0.09, 0, 0}, {0.18, 0, 0}, {0.5, 1, 0}, {1, -1, 0}},
              {{0, 2, 3}, {1, 2, 3}, {2, 4, 3}, {0, 1, 3}});
  const MeshCleaningResult result = clean_mesh(mesh, options);
  EXPECT_EQ(result.degenerate_triangles, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), 2U);
  EXPECT_EQ(result.merged_vertices, 1U);
  EXPECT_EQ(result.duplicate_triangles, 1U);
}

TEST(MeshRepair, BadTrianglesAreDropped) {
  TriangleMesh mesh = with_values(geodesic_mesh(3, 1.0));
  const std::size_t sound = mesh.triangles.size();
  const libmap::Triangle first = mesh.triangles[0];
  for (const libmap::Triangle& bad : {first,
                                      libmap::Triangle{first[1], first[0], first[2]},
                                      {first[0], first[0], first[1]},
                                      {5, 5, 5}}) {
    mesh.triangles.push_back(bad);
    mesh.face_fields[0].values.push_back(9999);
  }
  mesh.vertices.emplace_back(50, 50, 50);
  mesh.vertex_colors.push_back({1, 2, 3});
  for (libmap::ScalarField& field : mesh.vertex_fields) field.values.push_back(4);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.duplicate_triangles, 2U);
  EXPECT_EQ(result.degenerate_triangles, 2U);
  EXPECT_EQ(result.unused_vertices, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), sound);
  EXPECT_TRUE(report_mesh(result.mesh).is_watertight());
}

// A vertex in the middle of another triangle's edge, connected by a triangle without area.
TEST(MeshRepair, CapIsFlipped) {
  const TriangleMesh mesh = mesh_of({{0, 0, 0}, {2, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, -1, 0}},
                                    {{0, 2, 3}, {2, 1, 3}, {0, 1, 2}, {1, 0, 4}});
  ASSERT_EQ(report_mesh(mesh).degenerate_triangles, 1U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.degenerate_triangles, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), 4U);
  EXPECT_EQ(result.mesh.vertices, mesh.vertices);
  EXPECT_NEAR(libmap::surface_area(result.mesh), 2.0, 1e-12);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.boundaries.size(), 1U);
  EXPECT_EQ(report.boundary_edges, 4U);
}

// A row of caps along one edge, and a cap at a boundary.
TEST(MeshRepair, FansOfCaps) {
  TriangleMesh mesh;
  const std::uint32_t points = 40;
  for (std::uint32_t n = 0; n <= points; ++n) mesh.vertices.emplace_back(n, 0, 0);
  mesh.vertices.emplace_back(20, 15, 0);
  mesh.vertices.emplace_back(20, -15, 0);
  for (std::uint32_t n = 0; n < points; ++n) mesh.triangles.push_back({n, n + 1, points + 1});
  for (std::uint32_t n = 1; n < points; ++n) mesh.triangles.push_back({0, n + 1, n});
  mesh.triangles.push_back({points, 0, points + 2});
  MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_NEAR(libmap::surface_area(result.mesh), 600.0, 1e-9);
  EXPECT_EQ(report_mesh(result.mesh).boundaries.size(), 1U);
  EXPECT_EQ(result.mesh.vertices.size(), mesh.vertices.size());
  mesh.triangles.pop_back();  // the caps are now at a boundary
  result = cleaned(mesh, repairs());
  EXPECT_NEAR(libmap::surface_area(result.mesh), 300.0, 1e-9);
  EXPECT_EQ(result.mesh.triangles.size(), points);
}

TEST(MeshRepair, FinOnASurfaceIsCutOff) {
  TriangleMesh mesh = terrain_mesh(10, 1.0, [](double, double) { return 0.0; });
  // A wall on an inner edge, along y.
  const std::uint32_t a = 5 * 11 + 4;
  const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.emplace_back(mesh.vertices[a] + Eigen::Vector3d(0, 0, 0.2));
  mesh.vertices.emplace_back(mesh.vertices[a + 1] + Eigen::Vector3d(0, 0, 0.2));
  mesh.triangles.push_back({a, a + 1, n});
  mesh.triangles.push_back({a + 1, n + 1, n});
  ASSERT_EQ(report_mesh(mesh).non_manifold_edges, 1U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.cut_edges, 1U);
  EXPECT_EQ(result.split_vertices, 2U);
  EXPECT_EQ(result.mesh.triangles.size(), mesh.triangles.size());
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.components, 2U);
  // Vertices of the surface are unchanged.
  for (std::size_t v = 0; v < n; ++v) EXPECT_EQ(result.mesh.vertices[v], mesh.vertices[v]);
  MeshCleaningOptions islands = repairs();
  islands.min_island_area_m2 = 0.5;
  EXPECT_NEAR(libmap::surface_area(cleaned(mesh, islands).mesh), 1.0, 1e-12);
}

TEST(MeshRepair, CubesThatTouchAreParted) {
  for (const std::set<std::array<int, 3>>& cubes :
       {std::set<std::array<int, 3>>{{0, 0, 0}, {1, 1, 0}},
        {{0, 0, 0}, {1, 1, 1}},
        {{0, 0, 0}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1}}}) {
    const TriangleMesh mesh = cubes_mesh(cubes);
    const MeshCleaningResult result = cleaned(mesh, repairs());
    const MeshReport report = report_mesh(result.mesh);
    EXPECT_TRUE(report.is_watertight());
    EXPECT_EQ(report.triangles, mesh.triangles.size());
    EXPECT_GT(result.split_vertices, 0U);
    EXPECT_NEAR(report.volume_m3, static_cast<double>(cubes.size()), 0.05);
  }
}

TEST(MeshRepair, TwoConesJoinedAtAVertex) {
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, 0, 0);
  for (const double side : {1.0, -1.0})
    for (std::uint32_t n = 0; n < 12; ++n)
      mesh.vertices.emplace_back(std::cos(pi * n / 6), side * std::sin(pi * n / 6), side);
  for (const std::uint32_t first : {1U, 13U})
    for (std::uint32_t n = 0; n < 12; ++n)
      mesh.triangles.push_back({0, first + n, first + (n + 1) % 12});
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.split_vertices, 1U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.components, 2U);
  EXPECT_EQ(report.boundaries.size(), 2U);
}

// Copies of vertices are farther apart than the merge distance of a second cleaning.
TEST(MeshRepair, TinyFansStayApart) {
  TriangleMesh mesh = terrain_mesh(20, 10.0, [](double, double) { return 0.0; });
  const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.emplace_back(-5.0 - 5e-6, -5.0, 0.0);
  mesh.vertices.emplace_back(-5.0 - 5e-6, -5.0 - 5e-6, 0.0);
  mesh.triangles.push_back({0, n, n + 1});
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.split_vertices, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), mesh.triangles.size());
}

TEST(MeshRepair, TurnedTrianglesAreTurnedBack) {
  TriangleMesh mesh = geodesic_mesh(3, 1.0);
  const TriangleMesh original = mesh;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (uniform(0, 1) < 0.3) std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_GT(result.turned_triangles, 50U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_NEAR(report.volume_m3, libmap::signed_volume(original), 1e-12);  // oriented as most were
}

TEST(MeshRepair, OneSidedSurfacesAreCut) {
  const MeshCleaningResult strip = cleaned(graspmap_test::moebius_mesh(40, 4), repairs());
  EXPECT_EQ(strip.cut_edges, 4U);
  MeshReport report = report_mesh(strip.mesh);
  EXPECT_EQ(report.triangles, 320U);
  EXPECT_EQ(report.boundaries.size(), 1U);
  EXPECT_EQ(report.euler_characteristic, 1);  // a disc
  const MeshCleaningResult bottle = cleaned(graspmap_test::klein_mesh(60, 40), repairs());
  EXPECT_GT(bottle.cut_edges, 0U);
}

TEST(MeshRepair, FoldIsTakenOutAndClosed) {
  TriangleMesh mesh = terrain_mesh(40, 2.0, [](double x, double y) { return 0.1 * x * y; });
  // One vertex is moved below its neighbors, next to another one that is moved down.
  mesh.vertices[20 * 41 + 20] += Eigen::Vector3d(0.17, 0.02, -0.02);
  mesh.vertices[22 * 41 + 20].z() -= 0.05;
  ASSERT_GT(report_mesh(mesh).self_intersections, 0U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_GT(result.intersecting_triangles, 0U);
  EXPECT_GT(result.closing_triangles, 0U);
  EXPECT_EQ(result.unclosed_holes, 0U);
  EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.filled_triangles, result.closing_triangles);
  ASSERT_EQ(report.boundaries.size(), 1U);
  EXPECT_NEAR(report.boundaries[0].length_m, report_mesh(mesh).boundaries[0].length_m, 1e-9);
  for (const double d : libmap::distances_to_surface(
           result.mesh.vertices,
           terrain_mesh(40, 2.0, [](double x, double y) { return 0.1 * x * y; })))
    EXPECT_LT(d, 0.01);
}

// A tube through the ground cuts off a small disc, which is dropped, and the ground is closed.
TEST(MeshRepair, ScrapsOfIntersectionsAreDropped) {
  const TriangleMesh ground = terrain_mesh(40, 2.0, [](double, double) { return 0.0; });
  TriangleMesh tube = graspmap_test::cylinder_mesh(25, 12, 0.3, 0.6);
  for (Eigen::Vector3d& v : tube.vertices) v += Eigen::Vector3d(0.012, 0.017, -0.31);
  const MeshCleaningResult result = cleaned(graspmap_test::join_meshes(ground, tube), repairs());
  EXPECT_EQ(result.unclosed_holes, 0U);
  EXPECT_LT(result.intersecting_triangles, 450U);  // of one round
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.components, 3U);
  EXPECT_NEAR(report.largest_component_area_m2, 4.0, 0.01);
  EXPECT_EQ(report.boundaries.size(), 3U);  // boundary of the ground and both ends of the tube
}

TEST(MeshRepair, NoisyBallBecomesClean) {
  TriangleMesh mesh = with_values(geodesic_mesh(4, 1.0));
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.06 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  ASSERT_GT(report_mesh(mesh).self_intersections, 20U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
  EXPECT_GT(libmap::surface_area(result.mesh), 0.9 * libmap::surface_area(mesh));
  EXPECT_EQ(report_mesh(result.mesh).components, 1U);
}

TEST(MeshRepair, CrossingBallsAreParted) {
  const TriangleMesh mesh =
      graspmap_test::join_meshes(geodesic_mesh(4, 1.0), geodesic_mesh(4, 0.7, {1.1, 0.2, 0.13}));
  ASSERT_GT(report_mesh(mesh).self_intersections, 50U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
}

// Grid cells of this size would have infinite indices.
TEST(MeshRepair, VerticesAreJoinedWithinDistancesOfAnySize) {
  TriangleMesh mesh;
  for (int n = 0; n < 60000; ++n) mesh.vertices.emplace_back(n + 1.0, -2.0 * n, 1e30);
  mesh.vertices.push_back(mesh.vertices[5]);
  mesh.triangles = {{5, 6, 7}, {60000, 1, 2}};
  EXPECT_EQ(libmap::weld_vertices(mesh, 1e-310), 1U);
  EXPECT_EQ(mesh.triangles[1][0], 5U);
}

}  // namespace mesh_repair_test
