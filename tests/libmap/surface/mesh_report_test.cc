#include "libmap/surface/mesh_report.h"

#include <gtest/gtest.h>

#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/self_intersections.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/scenes/mesh_topology.h"
#include "tests/support/test_support.h"

namespace mesh_report_test {

using graspmap_test::cubes_mesh;
using graspmap_test::error_of;
using graspmap_test::uniform;
using libmap::MeshReport;
using libmap::report_mesh;
using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;

TriangleMesh mesh_of(std::vector<Eigen::Vector3d> vertices,
                     std::vector<libmap::Triangle> triangles) {
  TriangleMesh mesh;
  mesh.vertices = std::move(vertices);
  mesh.triangles = std::move(triangles);
  return mesh;
}

TEST(MeshReport, Torus) {
  const MeshReport report = report_mesh(graspmap_test::torus_mesh(120, 60, 1.0, 0.3));
  EXPECT_TRUE(report.is_watertight());
  EXPECT_EQ(report.genus, 1);
  EXPECT_EQ(report.euler_characteristic, 0);
  EXPECT_EQ(report.components, 1U);
  EXPECT_EQ(report.edges, 3U * 120 * 60);
  EXPECT_TRUE(report.boundaries.empty());
  EXPECT_NEAR(report.area_m2, 4 * pi * pi * 0.3, 0.02);
  EXPECT_NEAR(std::abs(report.volume_m3), 2 * pi * pi * 0.09, 0.02);
}

TEST(MeshReport, GenusOfSlabsWithHoles) {
  for (int holes = 0; holes <= 3; ++holes) {
    const MeshReport report = report_mesh(graspmap_test::slab_with_holes(holes));
    EXPECT_TRUE(report.is_watertight()) << holes;
    EXPECT_EQ(report.genus, holes);
    EXPECT_DOUBLE_EQ(report.volume_m3, 3.0 * (2 * holes + 1) - holes);
  }
}

TEST(MeshReport, ComponentsAddTheirGenus) {
  TriangleMesh mesh = graspmap_test::slab_with_holes(2);
  mesh = graspmap_test::join_meshes(mesh, graspmap_test::torus_mesh(20, 10, 30.0, 1.0));
  mesh = graspmap_test::join_meshes(mesh, graspmap_test::geodesic_mesh(2, 1.0, {0, 0, 20}));
  const MeshReport report = report_mesh(mesh);
  EXPECT_EQ(report.components, 3U);
  EXPECT_EQ(report.genus, 3);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_GT(report.largest_component_area_m2, 0.8 * report.area_m2);
}

TEST(MeshReport, OpenDisc) {
  const int columns = 400;
  const TriangleMesh disc = [&] {
    TriangleMesh fan;
    fan.vertices.emplace_back(0, 0, 0);
    for (std::uint32_t c = 0; c < columns; ++c) {
      const double a = 2 * pi * c / columns;
      fan.vertices.emplace_back(2 * std::cos(a), 2 * std::sin(a), 0);
      fan.triangles.push_back({0, c + 1, (c + 1) % columns + 1});
    }
    return fan;
  }();
  const MeshReport report = report_mesh(disc);
  ASSERT_EQ(report.boundaries.size(), 1U);
  EXPECT_EQ(report.boundaries[0].edges, columns);
  EXPECT_NEAR(report.boundaries[0].length_m, 4 * pi, 1e-3);
  EXPECT_NEAR(report.boundaries[0].diameter_m, 4.0, 1e-12);
  EXPECT_EQ(report.genus, 0);
  EXPECT_FALSE(report.is_closed());
  EXPECT_FALSE(report.is_watertight());
  EXPECT_TRUE(report.is_manifold() && report.is_oriented());
  EXPECT_EQ(report.volume_m3, 0.0);
}

TEST(MeshReport, DiameterOfAVeryLongBoundary) {
  const MeshReport report =
      report_mesh(graspmap_test::cylinder_mesh(1, 5000, 1.0, 0.1), {.self_intersections = false});
  ASSERT_EQ(report.boundaries.size(), 2U);
  EXPECT_LE(report.boundaries[0].diameter_m, 2.0 + 1e-12);
  EXPECT_GE(report.boundaries[0].diameter_m, 2.0 * (1 - 0.002));
}

TEST(MeshReport, CylinderHasTwoBoundariesLongestFirst) {
  // A truncated cone: the lower boundary is longer.
  const TriangleMesh cone = graspmap_test::grid_mesh(
      8, 300, graspmap_test::Seam::open, graspmap_test::Seam::closed, [](double u, double v) {
        const double r = 1.0 + u;
        return Eigen::Vector3d(r * std::cos(2 * pi * v), r * std::sin(2 * pi * v), u);
      });
  const MeshReport report = report_mesh(cone);
  EXPECT_EQ(report.genus, 0);
  ASSERT_EQ(report.boundaries.size(), 2U);
  EXPECT_NEAR(report.boundaries[0].length_m, 4 * pi, 1e-2);
  EXPECT_NEAR(report.boundaries[1].length_m, 2 * pi, 1e-2);
}

TEST(MeshReport, MoebiusStripIsOneSided) {
  const MeshReport report = report_mesh(graspmap_test::moebius_mesh(40, 4));
  EXPECT_TRUE(report.is_manifold());
  EXPECT_FALSE(report.is_oriented());
  EXPECT_EQ(report.misoriented_edges, 4U);
  EXPECT_EQ(report.boundaries.size(), 1U);
  EXPECT_EQ(report.euler_characteristic, 0);
  EXPECT_EQ(report.genus, -1);
}

TEST(MeshReport, KleinBottle) {
  const MeshReport report = report_mesh(graspmap_test::klein_mesh(60, 40));
  EXPECT_TRUE(report.is_closed());
  EXPECT_FALSE(report.is_oriented());
  EXPECT_EQ(report.euler_characteristic, 0);
  EXPECT_GT(report.self_intersections, 0U);
  EXPECT_FALSE(report.is_watertight());
}

TEST(MeshReport, EdgeLengths) {
  const MeshReport report =
      report_mesh(graspmap_test::terrain_mesh(10, 20.0, [](double, double) { return 0.0; }));
  EXPECT_NEAR(report.edge_lengths.min_m, 2.0, 1e-12);
  EXPECT_NEAR(report.edge_lengths.median_m, 2.0, 1e-12);
  EXPECT_NEAR(report.edge_lengths.max_m, std::sqrt(8.0), 1e-12);
}

TEST(MeshReport, ThreeTrianglesOnAnEdge) {
  const MeshReport report = report_mesh(mesh_of(
      {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}));
  EXPECT_EQ(report.non_manifold_edges, 1U);
  EXPECT_EQ(report.non_manifold_vertices, 0U);
  EXPECT_EQ(report.self_intersections, 0U);
  EXPECT_EQ(report.genus, -1);
}

TEST(MeshReport, CubesThatTouch) {
  const MeshReport at_corner = report_mesh(cubes_mesh({{0, 0, 0}, {1, 1, 1}}));
  EXPECT_EQ(at_corner.non_manifold_vertices, 1U);
  EXPECT_EQ(at_corner.non_manifold_edges, 0U);
  EXPECT_EQ(at_corner.components, 2U);
  const MeshReport at_edge = report_mesh(cubes_mesh({{0, 0, 0}, {1, 1, 0}}));
  EXPECT_EQ(at_edge.non_manifold_edges, 1U);
  EXPECT_EQ(at_edge.non_manifold_vertices, 0U);
  EXPECT_FALSE(at_edge.is_closed());
}

// Boundaries that touch in a vertex each follow their own triangles.
TEST(MeshReport, BowTieHasTwoBoundaries) {
  const MeshReport report = report_mesh(
      mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}));
  EXPECT_EQ(report.non_manifold_vertices, 1U);
  ASSERT_EQ(report.boundaries.size(), 2U);
  EXPECT_EQ(report.boundaries[0].edges, 3U);
  EXPECT_EQ(report.boundaries[1].edges, 3U);
}

TEST(MeshReport, BadTriangles) {
  TriangleMesh mesh = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0, 0}, {9, 9, 9}},
                              {{0, 1, 2}, {2, 1, 0}, {1, 3, 2}, {1, 1, 3}, {0, 4, 1}});
  mesh.face_fields.push_back({"filled", libmap::ScalarType::uint8, {0, 1, 1, 0, 0}});
  const MeshReport report = report_mesh(mesh);
  EXPECT_EQ(report.duplicate_triangles, 1U);
  EXPECT_EQ(report.degenerate_triangles, 2U);
  EXPECT_EQ(report.unused_vertices, 1U);
  EXPECT_EQ(report.filled_triangles, 2U);
}

TEST(MeshReport, TurnedTriangle) {
  TriangleMesh mesh = graspmap_test::geodesic_mesh(2, 1.0);
  std::swap(mesh.triangles[7][0], mesh.triangles[7][1]);
  const MeshReport report = report_mesh(mesh);
  EXPECT_EQ(report.misoriented_edges, 3U);
  EXPECT_TRUE(report.is_manifold());
  EXPECT_EQ(report.volume_m3, 0.0);
}

TEST(MeshReport, InsideOutHasNegativeVolume) {
  TriangleMesh mesh = graspmap_test::geodesic_mesh(3, 1.0);
  const double volume = report_mesh(mesh).volume_m3;
  EXPECT_NEAR(volume, 4.0 / 3.0 * pi, 0.1);
  for (libmap::Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  EXPECT_NEAR(report_mesh(mesh).volume_m3, -volume, 1e-12);
}

TEST(MeshReport, TheSameWhereverItLies) {
  TriangleMesh mesh = graspmap_test::join_meshes(graspmap_test::klein_mesh(30, 20),
                                                 graspmap_test::torus_mesh(20, 10, 1.5, 1.2));
  // No corner is exactly on another triangle, where rounding would decide.
  for (Eigen::Vector3d& v : mesh.vertices)
    v += Eigen::Vector3d(uniform(-0.01, 0.01), uniform(-0.01, 0.01), uniform(-0.01, 0.01));
  const MeshReport here = report_mesh(mesh);
  libmap::Pose pose = libmap::Pose::Identity();
  pose.translate(Eigen::Vector3d(300.0, -20.0, 5.0));
  pose.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  const MeshReport there = report_mesh(libmap::transform_mesh(mesh, pose));
  EXPECT_GT(here.self_intersections, 100U);
  EXPECT_EQ(here.self_intersections, there.self_intersections);
  EXPECT_EQ(here.components, there.components);
  EXPECT_NEAR(here.area_m2, there.area_m2, 1e-9);
}

TEST(MeshReport, NoTriangles) {
  const MeshReport report = report_mesh({});
  EXPECT_EQ(report.triangles, 0U);
  EXPECT_FALSE(report.is_closed());
  EXPECT_EQ(report.genus, -1);
  EXPECT_EQ(report_mesh(mesh_of({{0, 0, 0}}, {})).unused_vertices, 1U);
}

TEST(MeshReport, HostileMeshes) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error_of([] {
              report_mesh(mesh_of({{0, 0, 0}}, {{0, 0, 7}}));
            })
                .context()
                .field,
            "vertex of triangle 0");
  for (const double bad : {std::nan(""), inf, 1e200})
    EXPECT_EQ(error_of([&] {
                report_mesh(mesh_of({{0, 0, 0}, {0, bad, 0}, {1, 0, 0}}, {{0, 1, 2}}));
              })
                  .context()
                  .field,
              "vertex 1");
  const MeshReport one_place = report_mesh(mesh_of({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}));
  EXPECT_EQ(one_place.degenerate_triangles, 1U);
  const MeshReport twice = report_mesh(mesh_of({{0, 0, 0}, {1, 0, 0}}, {{0, 0, 1}, {1, 1, 1}}));
  EXPECT_EQ(twice.degenerate_triangles, 2U);
  EXPECT_EQ(twice.edges, 0U);
}

TEST(SelfIntersections, AsCgalFindsThem) {
  for (int trial = 0; trial < 6; ++trial) {
    TriangleMesh mesh = trial % 2 == 0 ? graspmap_test::geodesic_mesh(4, 1.0)
                                       : graspmap_test::torus_mesh(50, 24, 1.0, 0.4);
    const double noise = 0.04 + 0.02 * trial;
    for (Eigen::Vector3d& v : mesh.vertices)
      v += Eigen::Vector3d(uniform(-noise, noise), uniform(-noise, noise), uniform(-noise, noise));
    const auto found = libmap::find_self_intersections(mesh);
    EXPECT_EQ(found.size(), graspmap_test::self_intersections(mesh.vertices, mesh.triangles));
    EXPECT_GE(found.size(), trial == 5 ? 100U : 0U);
  }
}

TEST(SelfIntersections, Touching) {
  const std::vector<Eigen::Vector3d> base = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  const auto pairs = [&](std::vector<Eigen::Vector3d> more, libmap::Triangle other) {
    std::vector<Eigen::Vector3d> vertices = base;
    vertices.insert(vertices.end(), more.begin(), more.end());
    return libmap::find_self_intersections(mesh_of(vertices, {{0, 1, 2}, other})).size();
  };
  EXPECT_EQ(pairs({{1, 1, 0}, {1, 1, 1}, {2, 1, 1}}, {3, 4, 5}), 1U);    // a corner on it
  EXPECT_EQ(pairs({{1, 1, 0.1}, {1, 1, 1}, {2, 1, 1}}, {3, 4, 5}), 0U);  // just above
  EXPECT_EQ(pairs({{1, 1, -1}, {1, 1, 1}, {2, 1, 1}}, {3, 4, 5}), 1U);   // through it
  EXPECT_EQ(pairs({{1, 1, 0}, {1, 2, 0}, {2, 1, 0}}, {3, 4, 5}), 1U);    // inside its plane
  EXPECT_EQ(pairs({{0, 0, 0}, {-1, 0, 0}, {0, -1, 0}}, {3, 4, 5}), 1U);  // coincident corners
  EXPECT_EQ(pairs({{-1, 0, 0}, {0, -1, 0}}, {0, 3, 4}), 0U);             // a corner in common
  EXPECT_EQ(pairs({{1, 1, 1}, {1, 1, -1}}, {0, 3, 4}), 1U);              // and through it
  EXPECT_EQ(pairs({{1, 1, 0}, {9, 1, 0}}, {0, 3, 4}), 1U);               // and folded onto it
  EXPECT_EQ(pairs({{4, -4, 0}}, {1, 0, 3}), 0U);                         // an edge in common
  EXPECT_EQ(pairs({{1, 1, 0}}, {1, 0, 3}), 1U);                          // and folded onto it
  EXPECT_EQ(pairs({{1, 1, 0.001}}, {1, 0, 3}), 0U);                      // nearly
  EXPECT_EQ(pairs({}, {0, 2, 1}), 0U);                                   // the same corners
}

// In map coordinates, whose single-precision steps are as large as the triangles. The shift is
// exact.
TEST(SelfIntersections, TheSameFarFromTheOrigin) {
  TriangleMesh mesh = graspmap_test::geodesic_mesh(4, 1.0);
  for (Eigen::Vector3d& v : mesh.vertices)
    for (double& x : v) x = std::round(65536.0 * (x + uniform(-0.08, 0.08))) / 65536.0;
  const auto near = libmap::find_self_intersections(mesh);
  for (Eigen::Vector3d& v : mesh.vertices) v += Eigen::Vector3d(451230.0, 5412340.0, 812.0);
  ASSERT_GT(near.size(), 20U);
  EXPECT_EQ(libmap::find_self_intersections(mesh), near);
}

TEST(SelfIntersections, OnlyOfMarkedTriangles) {
  TriangleMesh mesh = graspmap_test::geodesic_mesh(4, 1.0);
  for (Eigen::Vector3d& v : mesh.vertices)
    v += Eigen::Vector3d(uniform(-0.08, 0.08), uniform(-0.08, 0.08), uniform(-0.08, 0.08));
  const auto all = libmap::find_self_intersections(mesh);
  std::vector<bool> marks(mesh.triangles.size());
  for (std::size_t t = 0; t < marks.size(); ++t) marks[t] = uniform(0, 1) < 0.2;
  std::vector<libmap::TrianglePair> wanted;
  for (const auto& pair : all)
    if (marks[pair.first] || marks[pair.second]) wanted.push_back(pair);
  ASSERT_GT(wanted.size(), 20U);
  ASSERT_LT(wanted.size(), all.size());
  EXPECT_EQ(libmap::find_self_intersections(mesh, marks), wanted);
  const libmap::ThreadLimit one(1);
  EXPECT_EQ(libmap::find_self_intersections(mesh), all);
}

}  // namespace mesh_report_test
