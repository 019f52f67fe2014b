#include "libmap/mesh/mesh_cleaning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "libmap/core/parallel.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/mesh_report.h"
#include "libmap/mesh/surface_distance.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/simulate/mesh_topology.h"
#include "tests/support/test_support.h"

namespace {

using graspmap_test::cubes_mesh;
using graspmap_test::error_of;
using graspmap_test::geodesic_mesh;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;
using libmap::clean_mesh;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::MeshReport;
using libmap::report_mesh;
using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;

// Repairs alone: nothing that depends on lengths in metres.
MeshCleaningOptions repairs() { return {.min_island_area_m2 = 0.0, .max_hole_m = 0.0}; }

MeshCleaningOptions holes_up_to(double diameter_m) {
  MeshCleaningOptions options = repairs();
  options.max_hole_m = diameter_m;
  return options;
}

TriangleMesh mesh_of(std::vector<Eigen::Vector3d> vertices,
                     std::vector<libmap::Triangle> triangles) {
  TriangleMesh mesh;
  mesh.vertices = std::move(vertices);
  mesh.triangles = std::move(triangles);
  return mesh;
}

// A mesh with every kind of value.
TriangleMesh with_values(TriangleMesh mesh) {
  libmap::ScalarField height{"height", libmap::ScalarType::float64, {}};
  libmap::ScalarField label{"label", libmap::ScalarType::int32, {}};
  for (const Eigen::Vector3d& v : mesh.vertices) {
    height.values.push_back(v.z() + 2.0 * v.x());
    label.values.push_back(v.x() > 0.0 ? 7.0 : -3.0);
    const auto red = static_cast<std::uint8_t>(std::clamp(128.0 + 60.0 * v.x(), 0.0, 255.0));
    mesh.vertex_colors.push_back({red, 50, 200});
  }
  mesh.vertex_fields = {height, label};
  libmap::ScalarField number{"number", libmap::ScalarType::uint32, {}};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    number.values.push_back(static_cast<double>(t));
  mesh.face_fields = {number};
  return mesh;
}

const libmap::ScalarField& field_of(const std::vector<libmap::ScalarField>& fields,
                                    const std::string& name) {
  for (const libmap::ScalarField& field : fields)
    if (field.name == name) return field;
  throw std::runtime_error("no field " + name);
}

// The triangles for whose middle `keep` holds.
TriangleMesh kept_where(const TriangleMesh& mesh,
                        const std::function<bool(const Eigen::Vector3d&)>& keep) {
  std::vector<bool> marks;
  for (const libmap::Triangle& t : mesh.triangles)
    marks.push_back(keep((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0));
  return libmap::select_triangles(mesh, marks);
}

testing::AssertionResult same_geometry(const TriangleMesh& a, const TriangleMesh& b) {
  if (a.triangles != b.triangles)
    return testing::AssertionFailure()
           << "triangles differ: " << a.triangles.size() << ", " << b.triangles.size();
  if (a.vertices != b.vertices) return testing::AssertionFailure() << "vertices differ";
  return testing::AssertionSuccess();
}

testing::AssertionResult same_mesh(const TriangleMesh& a, const TriangleMesh& b) {
  if (const auto same = same_geometry(a, b); !same) return same;
  if (a.vertex_normals != b.vertex_normals || a.vertex_colors != b.vertex_colors)
    return testing::AssertionFailure() << "normals or colours differ";
  if (a.vertex_fields != b.vertex_fields || a.face_fields != b.face_fields)
    return testing::AssertionFailure() << "fields differ";
  return testing::AssertionSuccess();
}

// No fault in its report, an independent count of the same, arrays that fit.
void expect_clean(const TriangleMesh& mesh) {
  EXPECT_NO_THROW(mesh.check());
  const MeshReport report = report_mesh(mesh);
  EXPECT_EQ(report.non_manifold_edges, 0U);
  EXPECT_EQ(report.non_manifold_vertices, 0U);
  EXPECT_EQ(report.misoriented_edges, 0U);
  EXPECT_EQ(report.degenerate_triangles, 0U);
  EXPECT_EQ(report.duplicate_triangles, 0U);
  EXPECT_EQ(report.unused_vertices, 0U);
  EXPECT_EQ(report.self_intersections, 0U);
  EXPECT_TRUE(report.is_clean());
  const auto topology = graspmap_test::topology_of(mesh.vertices.size(), mesh.triangles);
  EXPECT_EQ(topology.bad_edges, 0U);
  EXPECT_EQ(topology.unused_vertices, 0U);
  EXPECT_EQ(topology.parts, report.components);
  EXPECT_EQ(topology.open_edges, report.boundary_edges);
  EXPECT_EQ(mesh.vertex_normals.size(), mesh.vertices.size());
  EXPECT_EQ(field_of(mesh.face_fields, "filled").values.size(), mesh.triangles.size());
}

// Clean, and cleaning it again changes nothing.
MeshCleaningResult cleaned(const TriangleMesh& mesh, const MeshCleaningOptions& options) {
  MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  const MeshCleaningResult again = clean_mesh(result.mesh, options);
  EXPECT_TRUE(same_mesh(again.mesh, result.mesh));
  EXPECT_EQ(again.merged_vertices + again.split_vertices + again.intersecting_triangles, 0U);
  return result;
}

TEST(MeshCleaning, CleanMeshesPassUnchanged) {
  const auto waves = [](double x, double y) { return 0.1 * std::sin(5 * x) * std::cos(4 * y); };
  for (const TriangleMesh& clean :
       {graspmap_test::torus_mesh(40, 20, 1.0, 0.3), geodesic_mesh(3, 1.0),
        terrain_mesh(40, 2.0, waves), graspmap_test::slab_with_holes(2)}) {
    const TriangleMesh mesh = with_values(clean);
    const MeshCleaningResult result = cleaned(mesh, {});
    EXPECT_TRUE(same_geometry(result.mesh, mesh));
    EXPECT_EQ(result.mesh.vertex_colors, mesh.vertex_colors);
    EXPECT_EQ(result.mesh.vertex_fields, mesh.vertex_fields);
    EXPECT_EQ(field_of(result.mesh.face_fields, "number").values,
              field_of(mesh.face_fields, "number").values);
    EXPECT_EQ(result.intersecting_triangles + result.cut_edges + result.merged_vertices, 0U);
  }
}

TEST(MeshCleaning, TriangleSoupIsWelded) {
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

TEST(MeshCleaning, MergeDistance) {
  MeshCleaningOptions options = repairs();
  options.merge_distance_m = 0.1;
  // Along a line, each within 0.1 of the one before: the third is too far from the first, which
  // the second is joined to.
  const TriangleMesh mesh =
      mesh_of({{0, 0, 0}, {0.09, 0, 0}, {0.18, 0, 0}, {0.5, 1, 0}, {1, -1, 0}},
              {{0, 2, 3}, {1, 2, 3}, {2, 4, 3}, {0, 1, 3}});
  const MeshCleaningResult result = clean_mesh(mesh, options);
  EXPECT_EQ(result.degenerate_triangles, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), 2U);
  EXPECT_EQ(result.merged_vertices, 1U);
  EXPECT_EQ(result.duplicate_triangles, 1U);
}

TEST(MeshCleaning, BadTrianglesAreDropped) {
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

// A vertex in the middle of another triangle's edge, joined by a triangle without area.
TEST(MeshCleaning, CapIsFlipped) {
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

// Many caps along one edge, and a cap at a boundary.
TEST(MeshCleaning, FansOfCaps) {
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
  mesh.triangles.pop_back();  // now the caps end at a boundary
  result = cleaned(mesh, repairs());
  EXPECT_NEAR(libmap::surface_area(result.mesh), 300.0, 1e-9);
  EXPECT_EQ(result.mesh.triangles.size(), points);
}

TEST(MeshCleaning, FinOnASurfaceIsCutOff) {
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
  // The surface keeps its vertices.
  for (std::size_t v = 0; v < n; ++v) EXPECT_EQ(result.mesh.vertices[v], mesh.vertices[v]);
  MeshCleaningOptions islands = repairs();
  islands.min_island_area_m2 = 0.5;
  EXPECT_NEAR(libmap::surface_area(cleaned(mesh, islands).mesh), 1.0, 1e-12);
}

TEST(MeshCleaning, CubesThatTouchAreParted) {
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

TEST(MeshCleaning, TwoConesJoinedAtAVertex) {
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

// Copies of vertices lie farther apart than what a second cleaning makes one.
TEST(MeshCleaning, TinyFansStayApart) {
  TriangleMesh mesh = terrain_mesh(20, 10.0, [](double, double) { return 0.0; });
  const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.emplace_back(-5.0 - 5e-6, -5.0, 0.0);
  mesh.vertices.emplace_back(-5.0 - 5e-6, -5.0 - 5e-6, 0.0);
  mesh.triangles.push_back({0, n, n + 1});
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.split_vertices, 1U);
  EXPECT_EQ(result.mesh.triangles.size(), mesh.triangles.size());
}

TEST(MeshCleaning, TurnedTrianglesAreTurnedBack) {
  TriangleMesh mesh = geodesic_mesh(3, 1.0);
  const TriangleMesh original = mesh;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (uniform(0, 1) < 0.3) std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_GT(result.turned_triangles, 50U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_NEAR(report.volume_m3, libmap::signed_volume(original), 1e-12);  // outward, as most were
}

TEST(MeshCleaning, OneSidedSurfacesAreCut) {
  const MeshCleaningResult strip = cleaned(graspmap_test::moebius_mesh(40, 4), repairs());
  EXPECT_EQ(strip.cut_edges, 4U);
  MeshReport report = report_mesh(strip.mesh);
  EXPECT_EQ(report.triangles, 320U);
  EXPECT_EQ(report.boundaries.size(), 1U);
  EXPECT_EQ(report.euler_characteristic, 1);  // a disc
  const MeshCleaningResult bottle = cleaned(graspmap_test::klein_mesh(60, 40), repairs());
  EXPECT_GT(bottle.cut_edges, 0U);
}

TEST(MeshCleaning, IslandsAreDropped) {
  TriangleMesh mesh = geodesic_mesh(4, 1.0);
  mesh = libmap::join_meshes(mesh, geodesic_mesh(2, 0.2, {3, 0, 0}));  // 0.5 m2
  mesh = libmap::join_meshes(mesh, geodesic_mesh(1, 0.1, {4, 0, 0}));  // 0.1 m2
  MeshCleaningOptions options = repairs();
  options.min_island_area_m2 = 0.2;
  MeshCleaningResult result = cleaned(mesh, options);
  EXPECT_EQ(result.islands, 1U);
  EXPECT_EQ(report_mesh(result.mesh).components, 2U);
  EXPECT_NEAR(result.island_area_m2 + libmap::surface_area(result.mesh), libmap::surface_area(mesh),
              1e-12);
  options.min_island_area_m2 = 0.0;
  options.min_island_share = 0.1;
  result = cleaned(mesh, options);
  EXPECT_EQ(result.islands, 2U);
  options.min_island_area_m2 = 100.0;
  const libmap::Error error = error_of([&] { clean_mesh(mesh, options); });
  EXPECT_EQ(error.context().field, "min_island_area_m2");
}

TEST(MeshCleaning, HoleInAPlaneIsFilled) {
  const TriangleMesh whole =
      with_values(terrain_mesh(60, 1.2, [](double, double) { return 0.25; }));
  const TriangleMesh mesh = kept_where(whole, [](const Eigen::Vector3d& p) {
    return std::abs(p.x() - 0.1) > 0.1 || std::abs(p.y()) > 0.08;  // 0.2 x 0.16 m
  });
  const double diameter = std::hypot(0.2, 0.16);
  const MeshCleaningResult kept = cleaned(mesh, holes_up_to(diameter - 0.001));
  EXPECT_EQ(kept.filled_holes, 0U);
  EXPECT_EQ(kept.mesh.triangles.size(), mesh.triangles.size());
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(diameter + 0.001));
  EXPECT_EQ(result.filled_holes, 1U);
  EXPECT_NEAR(result.filled_area_m2, 0.2 * 0.16, 1e-12);
  EXPECT_NEAR(libmap::surface_area(result.mesh), 1.44, 1e-12);
  // What there was before stays in its place.
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    ASSERT_EQ(result.mesh.vertices[v], mesh.vertices[v]);
  const libmap::ScalarField& filled = field_of(result.mesh.face_fields, "filled");
  EXPECT_EQ(filled.type, libmap::ScalarType::uint8);
  for (std::size_t t = 0; t < filled.values.size(); ++t)
    ASSERT_EQ(filled.values[t], t < mesh.triangles.size() ? 0.0 : 1.0);
  EXPECT_EQ(result.filled_triangles, filled.values.size() - mesh.triangles.size());
  // Triangles about as large as those around.
  EXPECT_GT(result.filled_triangles, 50U);
  EXPECT_LT(result.filled_triangles, 600U);
  const MeshReport report = report_mesh(result.mesh);
  ASSERT_EQ(report.boundaries.size(), 1U);
  EXPECT_NEAR(report.boundaries[0].length_m, 4.8, 1e-12);
}

TEST(MeshCleaning, ValuesOfNewVerticesComeFromTheBoundary) {
  const TriangleMesh whole = with_values(terrain_mesh(60, 1.2, [](double, double) { return 0.0; }));
  const TriangleMesh mesh =
      kept_where(whole, [](const Eigen::Vector3d& p) { return p.norm() > 0.15; });
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(0.5));
  ASSERT_GT(result.mesh.vertices.size(), mesh.vertices.size());
  const auto& height = field_of(result.mesh.vertex_fields, "height").values;
  const auto& label = field_of(result.mesh.vertex_fields, "label").values;
  for (std::size_t v = mesh.vertices.size(); v < result.mesh.vertices.size(); ++v) {
    const Eigen::Vector3d& place = result.mesh.vertices[v];
    EXPECT_NEAR(height[v], 2.0 * place.x(), 0.15);
    EXPECT_TRUE(label[v] == 7.0 || label[v] == -3.0);
    if (std::abs(place.x()) > 0.05) {
      EXPECT_EQ(label[v], place.x() > 0.0 ? 7.0 : -3.0);
    }
    EXPECT_NEAR(result.mesh.vertex_colors[v][0], 128.0 + 60.0 * place.x(), 6.0);
    EXPECT_EQ(result.mesh.vertex_colors[v][1], 50);
    EXPECT_NEAR(result.mesh.vertex_normals[v].z(), 1.0F, 1e-6F);
  }
  // Face fields are those of a triangle at the hole.
  const auto& number = field_of(result.mesh.face_fields, "number").values;
  for (std::size_t t = mesh.triangles.size(); t < number.size(); ++t) {
    const auto& corners = whole.triangles[static_cast<std::size_t>(number[t])];
    EXPECT_NEAR(whole.vertices[corners[0]].norm(), 0.15, 0.05);
  }
}

// The patch goes on in the surface's tangent planes.
TEST(MeshCleaning, HoleInABallIsFilledRound) {
  const TriangleMesh ball = geodesic_mesh(5, 1.0);
  const TriangleMesh mesh = kept_where(ball, [](const Eigen::Vector3d& p) { return p.z() < 0.9; });
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(0.95));
  EXPECT_EQ(result.filled_holes, 1U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_EQ(report.genus, 0);
  double lowest = 1.0;
  double highest = 1.0;
  for (const Eigen::Vector3d& v : result.mesh.vertices) {
    lowest = std::min(lowest, v.norm());
    highest = std::max(highest, v.norm());
  }
  // A flat lid would lie 0.1 below the ball.
  EXPECT_GT(lowest, 0.97);
  EXPECT_LT(highest, 1.03);
  EXPECT_NEAR(report.volume_m3, libmap::signed_volume(ball), 0.01 * libmap::signed_volume(ball));
}

TEST(MeshCleaning, OuterBoundariesAreNeverFilled) {
  // Smaller than the largest hole allowed, all of them.
  const MeshCleaningOptions options = holes_up_to(10.0);
  for (const TriangleMesh& open :
       {terrain_mesh(20, 1.0, [](double x, double y) { return x * y; }),
        kept_where(geodesic_mesh(4, 1.0), [](const Eigen::Vector3d&p) { return p.z() > 0.0; }),
        graspmap_test::grid_mesh(
            4, 30, graspmap_test::Seam::open, graspmap_test::Seam::open,
            [](double u, double v) { return Eigen::Vector3d(v, 0.1 * u, 0); })}) {
    const MeshCleaningResult result = cleaned(open, options);
    EXPECT_EQ(result.filled_holes, 0U);
    EXPECT_TRUE(same_geometry(result.mesh, open));
  }
  // A ring keeps its outer boundary, and its inner one is filled.
  const TriangleMesh ring = graspmap_test::grid_mesh(
      3, 40, graspmap_test::Seam::open, graspmap_test::Seam::closed, [](double u, double v) {
        const double r = 1.0 + 0.3 * u;
        return Eigen::Vector3d(r * std::cos(2 * pi * v), r * std::sin(2 * pi * v), 0);
      });
  const MeshCleaningResult result = cleaned(ring, options);
  EXPECT_EQ(result.filled_holes, 1U);
  ASSERT_EQ(report_mesh(result.mesh).boundaries.size(), 1U);
  EXPECT_NEAR(report_mesh(result.mesh).boundaries[0].length_m, 2 * pi * 1.3, 0.02);
}

TEST(MeshCleaning, LongTubeIsClosedAtItsEnds) {
  const TriangleMesh tube = graspmap_test::cylinder_mesh(60, 24, 0.1, 1.5);
  const MeshCleaningResult result = cleaned(tube, holes_up_to(0.25));
  EXPECT_EQ(result.filled_holes, 2U);
  EXPECT_TRUE(report_mesh(result.mesh).is_watertight());
}

// A patch over this hole would run through the needle that stands in it.
TEST(MeshCleaning, PatchesMeetNothingElse) {
  TriangleMesh mesh = kept_where(terrain_mesh(40, 1.0, [](double, double) { return 0.0; }),
                                 [](const Eigen::Vector3d& p) { return p.norm() > 0.1; });
  const double area = libmap::surface_area(mesh);
  mesh = libmap::join_meshes(mesh, graspmap_test::cylinder_mesh(20, 12, 0.02, 0.5));
  for (std::size_t v = mesh.vertices.size() - 21 * 12; v < mesh.vertices.size(); ++v)
    mesh.vertices[v].z() -= 0.25;
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(0.3));
  EXPECT_EQ(result.unfilled_holes, 1U);
  EXPECT_EQ(result.filled_holes, 2U);  // the tube's ends
  EXPECT_GT(libmap::surface_area(result.mesh), area);
}

TEST(MeshCleaning, FoldIsTakenOutAndClosed) {
  TriangleMesh mesh = terrain_mesh(40, 2.0, [](double x, double y) { return 0.1 * x * y; });
  // One vertex is pulled below its neighbours, where another one hangs down.
  mesh.vertices[20 * 41 + 20] += Eigen::Vector3d(0.17, 0.02, -0.02);
  mesh.vertices[22 * 41 + 20].z() -= 0.05;
  ASSERT_GT(report_mesh(mesh).self_intersections, 0U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_GT(result.intersecting_triangles, 0U);
  EXPECT_GT(result.closing_triangles, 0U);
  EXPECT_EQ(result.open_places, 0U);
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

// A tube through the ground cuts a small disc out of it: that goes at once, and the ground is
// closed.
TEST(MeshCleaning, ScrapsOfIntersectionsAreDropped) {
  const TriangleMesh ground = terrain_mesh(40, 2.0, [](double, double) { return 0.0; });
  TriangleMesh tube = graspmap_test::cylinder_mesh(25, 12, 0.3, 0.6);
  for (Eigen::Vector3d& v : tube.vertices) v += Eigen::Vector3d(0.012, 0.017, -0.31);
  const MeshCleaningResult result = cleaned(libmap::join_meshes(ground, tube), repairs());
  EXPECT_EQ(result.open_places, 0U);
  EXPECT_LT(result.intersecting_triangles, 450U);  // one round's
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_EQ(report.components, 3U);
  EXPECT_NEAR(report.largest_component_area_m2, 4.0, 0.01);
  EXPECT_EQ(report.boundaries.size(), 3U);  // of the ground, and the tube's old ends
}

TEST(MeshCleaning, NoisyBallBecomesClean) {
  TriangleMesh mesh = with_values(geodesic_mesh(4, 1.0));
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.06 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  ASSERT_GT(report_mesh(mesh).self_intersections, 20U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
  EXPECT_GT(libmap::surface_area(result.mesh), 0.9 * libmap::surface_area(mesh));
  EXPECT_EQ(report_mesh(result.mesh).components, 1U);
}

TEST(MeshCleaning, CrossingBallsAreParted) {
  const TriangleMesh mesh =
      libmap::join_meshes(geodesic_mesh(4, 1.0), geodesic_mesh(4, 0.7, {1.1, 0.2, 0.13}));
  ASSERT_GT(report_mesh(mesh).self_intersections, 50U);
  const MeshCleaningResult result = cleaned(mesh, repairs());
  EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
}

TEST(MeshCleaning, SmoothingLowersNoiseAndKeepsVolume) {
  TriangleMesh mesh = geodesic_mesh(5, 1.0);
  const double volume = libmap::signed_volume(mesh);
  for (Eigen::Vector3d& v : mesh.vertices) v *= 1.0 + 0.004 * uniform(-1, 1);
  const auto roughness = [](const TriangleMesh& m) {
    double sum = 0.0;
    for (const Eigen::Vector3d& v : m.vertices) sum += std::pow(v.norm() - 1.0, 2);
    return std::sqrt(sum / static_cast<double>(m.vertices.size()));
  };
  MeshCleaningOptions options = repairs();
  options.smoothing_iterations = 20;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  EXPECT_EQ(result.mesh.triangles, mesh.triangles);
  EXPECT_LT(roughness(result.mesh), 0.4 * roughness(mesh));
  EXPECT_NEAR(libmap::signed_volume(result.mesh), volume, 0.002 * volume);
}

TEST(MeshCleaning, SmoothingLeavesBoundaries) {
  TriangleMesh mesh = terrain_mesh(30, 1.0, [](double, double) { return 0.0; });
  for (Eigen::Vector3d& v : mesh.vertices) v.z() += uniform(-0.002, 0.002);
  MeshCleaningOptions options = repairs();
  options.smoothing_iterations = 10;
  const TriangleMesh smooth = clean_mesh(mesh, options).mesh;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const bool is_border =
        std::max(std::abs(mesh.vertices[v].x()), std::abs(mesh.vertices[v].y())) > 0.4999;
    EXPECT_EQ(smooth.vertices[v] == mesh.vertices[v], is_border);
  }
}

// Many points of `a`, each triangle's corners and points between them, against the surface of `b`.
double sampled_distance(const TriangleMesh& a, const TriangleMesh& b) {
  std::vector<Eigen::Vector3d> points;
  constexpr int steps = 6;
  for (const libmap::Triangle& t : a.triangles)
    for (int i = 0; i <= steps; ++i)
      for (int j = 0; i + j <= steps; ++j)
        points.emplace_back(
            (i * a.vertices[t[0]] + j * a.vertices[t[1]] + (steps - i - j) * a.vertices[t[2]]) /
            steps);
  double largest = 0.0;
  for (const double d : libmap::distances_to_surface(points, b)) largest = std::max(largest, d);
  return largest;
}

TEST(MeshCleaning, DecimationKeepsItsBound) {
  const auto rocks = [](double x, double y) {
    return 0.1 * std::sin(4 * x) * std::cos(5 * y) + 0.003 * std::sin(31 * x + 17 * y);
  };
  TriangleMesh mesh = with_values(terrain_mesh(60, 1.0, rocks));
  for (Eigen::Vector3d& v : mesh.vertices) v.z() += uniform(-0.0002, 0.0002);
  for (const double bound : {0.001, 0.01}) {
    MeshCleaningOptions options = repairs();
    options.decimation_error_m = bound;
    const MeshCleaningResult result = clean_mesh(mesh, options);
    expect_clean(result.mesh);
    EXPECT_GT(result.decimated_triangles, mesh.triangles.size() / 3);
    EXPECT_EQ(result.decimated_triangles + result.mesh.triangles.size(), mesh.triangles.size());
    EXPECT_LE(result.decimation_deviation_m, bound);
    EXPECT_GT(result.decimation_deviation_m, 0.3 * bound);
    EXPECT_LE(sampled_distance(result.mesh, mesh), result.decimation_deviation_m + 1e-12);
    EXPECT_LE(sampled_distance(mesh, result.mesh), result.decimation_deviation_m + 1e-12);
    // What stays keeps its values.
    const libmap::SurfaceDistance original(mesh);
    const auto& height = field_of(result.mesh.vertex_fields, "height").values;
    for (std::size_t v = 0; v < result.mesh.vertices.size(); ++v)
      ASSERT_NEAR(height[v], result.mesh.vertices[v].z() + 2 * result.mesh.vertices[v].x(), 0.0006);
    EXPECT_EQ(result.mesh.vertex_colors.size(), result.mesh.vertices.size());
    EXPECT_EQ(field_of(result.mesh.face_fields, "number").values.size(),
              result.mesh.triangles.size());
  }
}

TEST(MeshCleaning, FlatGroundNeedsFewTriangles) {
  const TriangleMesh mesh = terrain_mesh(40, 1.0, [](double, double) { return 1.0; });
  MeshCleaningOptions options = repairs();
  options.decimation_error_m = 0.002;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  EXPECT_LT(result.mesh.triangles.size(), 100U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), 1.0, 0.004);
}

TEST(MeshCleaning, AllStepsTheSameForAnyNumberOfThreads) {
  TriangleMesh mesh = with_values(terrain_mesh(
      50, 1.0, [](double x, double y) { return 0.1 * std::sin(6 * x) + 0.05 * std::cos(9 * y); }));
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.002 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  mesh = kept_where(mesh, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.97; });
  MeshCleaningOptions options;
  options.smoothing_iterations = 3;
  options.decimation_error_m = 0.004;
  const TriangleMesh many = clean_mesh(mesh, options).mesh;
  expect_clean(many);
  const libmap::ThreadLimit one(1);
  EXPECT_TRUE(same_mesh(clean_mesh(mesh, options).mesh, many));
}

TEST(MeshCleaning, TheSameWhereverItLies) {
  TriangleMesh mesh = terrain_mesh(60, 2.0, [](double x, double y) { return 0.2 * x * y; });
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.012 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  mesh = kept_where(mesh, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.98; });
  libmap::Pose pose = libmap::Pose::Identity();
  pose.translate(Eigen::Vector3d(40.0, -20.0, 5.0));
  pose.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  const MeshCleaningResult here = clean_mesh(mesh, {});
  const MeshCleaningResult there = clean_mesh(libmap::transform_mesh(mesh, pose), {});
  EXPECT_GT(here.filled_holes, 20U);
  EXPECT_EQ(here.filled_holes, there.filled_holes);
  EXPECT_EQ(here.split_vertices, there.split_vertices);
  EXPECT_EQ(here.intersecting_triangles, there.intersecting_triangles);
  EXPECT_NEAR(libmap::surface_area(here.mesh), libmap::surface_area(there.mesh), 1e-3);
}

// Triangles between random points: every fault there is, all over the place.
TEST(MeshCleaning, RandomTriangles) {
  for (int trial = 0; trial < 150; ++trial) {
    TriangleMesh mesh;
    const auto count = static_cast<std::uint32_t>(uniform(3, trial < 75 ? 12 : 60));
    for (std::uint32_t v = 0; v < count; ++v) {
      Eigen::Vector3d place(uniform(0, 1), uniform(0, 1), uniform(0, 1));
      if (trial % 3 == 0) place = (4.0 * place).array().floor();  // many in one place, on one line
      if (trial % 5 == 0) place.z() = 0.0;
      mesh.vertices.push_back(place);
    }
    const auto vertex = [&] { return static_cast<std::uint32_t>(uniform(0, count - 0.001)); };
    const auto triangles = static_cast<std::size_t>(uniform(1, 4 * count));
    for (std::size_t t = 0; t < triangles; ++t)
      mesh.triangles.push_back({vertex(), vertex(), vertex()});
    mesh = with_values(std::move(mesh));
    const MeshCleaningOptions options = trial % 2 == 0 ? repairs() : holes_up_to(0.8);
    SCOPED_TRACE(trial);
    try {
      const MeshCleaningResult result = clean_mesh(mesh, options);
      expect_clean(result.mesh);
      EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
    } catch (const libmap::Error& error) {
      EXPECT_EQ(error.reason(), "nothing is left of the mesh");
    }
  }
}

TEST(MeshCleaning, HostileMeshes) {
  EXPECT_EQ(error_of([] { clean_mesh({}); }).reason(), "the mesh has no triangle");
  EXPECT_EQ(error_of([] {
              clean_mesh(mesh_of({{0, 0, 0}}, {{0, 1, 0}}));
            })
                .context()
                .field,
            "triangle 0");
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300})
    EXPECT_EQ(error_of([&] {
                clean_mesh(mesh_of({{0, 0, 0}, {0, bad, 0}, {1, 0, 0}}, {{0, 1, 2}}));
              })
                  .context()
                  .field,
              "vertex 1");
  TriangleMesh short_field = geodesic_mesh(1, 1.0);
  short_field.vertex_fields.push_back({"f", libmap::ScalarType::float32, {1.0}});
  EXPECT_EQ(error_of([&] { clean_mesh(short_field); }).context().field, "f");
  const auto none_left = [](const TriangleMesh& mesh) {
    EXPECT_EQ(error_of([&] { clean_mesh(mesh, repairs()); }).reason(),
              "nothing is left of the mesh");
  };
  none_left(mesh_of({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}));
  none_left(mesh_of({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}));
  none_left(mesh_of({{0, 0, 0}, {1, 0, 0}}, {{0, 0, 1}, {1, 1, 1}}));
  // One vertex a billion metres away: the others are one place against that.
  TriangleMesh far = geodesic_mesh(2, 1.0);
  far.vertices[0] = {1e9, 0, 0};
  EXPECT_NO_THROW({
    try {
      clean_mesh(far, repairs());
    } catch (const libmap::Error&) {
    }
  });
}

TEST(MeshCleaning, FarFromTheOrigin) {
  TriangleMesh mesh = terrain_mesh(20, 3.0, [](double x, double y) { return 0.2 * x * y; });
  for (Eigen::Vector3d& v : mesh.vertices) v += Eigen::Vector3d(5e5, 4.2e6, 100);
  const TriangleMesh holed = kept_where(mesh, [](const Eigen::Vector3d& p) {
    return (p - Eigen::Vector3d(5e5, 4.2e6, 100)).norm() > 0.4;
  });
  const MeshCleaningResult result = cleaned(holed, holes_up_to(1.5));
  EXPECT_EQ(result.filled_holes, 1U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), libmap::surface_area(mesh), 0.01);
}

TEST(MeshCleaning, ManyIslands) {
  TriangleMesh mesh;
  for (std::uint32_t n = 0; n < 60000; ++n) {
    const Eigen::Vector3d at(n % 250, n / 250, 0);
    for (const Eigen::Vector3d& corner :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, 0, 0), Eigen::Vector3d(0, 0.5, 0)})
      mesh.vertices.push_back(at + corner);
    mesh.triangles.push_back({3 * n, 3 * n + 1, 3 * n + 2});
  }
  const MeshCleaningResult result = clean_mesh(mesh, holes_up_to(0.1));
  EXPECT_TRUE(same_geometry(result.mesh, mesh));
}

TEST(MeshCleaning, OptionsOutOfRange) {
  const TriangleMesh mesh = geodesic_mesh(1, 1.0);
  const auto field = [&](const MeshCleaningOptions& options) {
    return error_of([&] { clean_mesh(mesh, options); }).context().field;
  };
  EXPECT_EQ(field({.merge_distance_m = -1}), "merge_distance_m");
  EXPECT_EQ(field({.min_island_area_m2 = std::nan("")}), "min_island_area_m2");
  EXPECT_EQ(field({.min_island_share = 1.5}), "min_island_share");
  EXPECT_EQ(field({.max_hole_m = -0.1}), "max_hole_m");
  EXPECT_EQ(field({.smoothing_iterations = -1}), "smoothing_iterations");
  EXPECT_EQ(field({.decimation_error_m = -1}), "decimation_error_m");
  MeshCleaningOptions options;
  libmap::ParameterTable table;
  libmap::bind(table, options);
  EXPECT_THROW(table.set("min_island_share", "2"), libmap::Error);
  table.set("max_hole_m", "0.3");
  EXPECT_EQ(options.max_hole_m, 0.3);
}

TEST(MeshCleaning, WithoutRepair) {
  TriangleMesh mesh = cubes_mesh({{0, 0, 0}, {1, 1, 1}});
  MeshCleaningOptions options = repairs();
  options.repair = false;
  EXPECT_EQ(clean_mesh(mesh, options).mesh.triangles, mesh.triangles);
  options.max_hole_m = 0.1;
  EXPECT_EQ(error_of([&] { clean_mesh(mesh, options); }).context().field, "repair");
}

TEST(MeshCleaning, TrueSiteWithTrianglesKnockedOut) {
  GRASPMAP_REQUIRE_DATA();
  const TriangleMesh whole = kept_where(
      libmap::read_mesh(graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply").mesh,
      [](const Eigen::Vector3d& p) { return p.head<2>().cwiseAbs().maxCoeff() < 1.0; });
  const TriangleMesh mesh =
      kept_where(whole, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.995; });
  const std::size_t knocked_out = whole.triangles.size() - mesh.triangles.size();
  MeshCleaningOptions options;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  EXPECT_GT(result.filled_holes, knocked_out / 2);
  EXPECT_EQ(result.unfilled_holes, 0U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), libmap::surface_area(whole),
              0.003 * libmap::surface_area(whole));
  const auto distances =
      libmap::distance_statistics(libmap::distances_to_surface(result.mesh.vertices, whole));
  EXPECT_LT(distances.rmse_m, 0.0003);
  EXPECT_LT(distances.max_m, 0.02);
}

}  // namespace
