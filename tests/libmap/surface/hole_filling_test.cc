// Patches of filled holes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_report.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/surface/cleaning_checks.h"

namespace hole_filling_test {

using graspmap_test::cleaned;
using graspmap_test::field_of;
using graspmap_test::geodesic_mesh;
using graspmap_test::holes_up_to;
using graspmap_test::kept_where;
using graspmap_test::same_geometry;
using graspmap_test::terrain_mesh;
using graspmap_test::with_values;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::MeshReport;
using libmap::report_mesh;
using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;

TEST(HoleFilling, HoleInAPlaneIsFilled) {
  const TriangleMesh whole =
      with_values(terrain_mesh(60, 1.2, [](double, double) { return 0.25; }));
  const TriangleMesh mesh = kept_where(whole, [](const Eigen::Vector3d& p) {
    return std::abs(p.x() - 0.1) > 0.1 || std::abs(p.y()) > 0.08;  // 0.2 x 0.16 m
  });
  const double diameter = std::hypot(0.2, 0.16);
  const MeshCleaningResult kept = cleaned(mesh, holes_up_to(diameter - 0.001));
  EXPECT_EQ(kept.filling.holes, 0U);
  EXPECT_EQ(kept.mesh.triangles.size(), mesh.triangles.size());
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(diameter + 0.001));
  EXPECT_EQ(result.filling.holes, 1U);
  EXPECT_NEAR(result.filling.area_m2, 0.2 * 0.16, 1e-12);
  EXPECT_NEAR(libmap::surface_area(result.mesh), 1.44, 1e-12);
  // The original vertices and triangles are unchanged.
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    ASSERT_EQ(result.mesh.vertices[v], mesh.vertices[v]);
  const libmap::ScalarField& filled = field_of(result.mesh.face_fields, "filled");
  EXPECT_EQ(filled.type, libmap::ScalarType::uint8);
  for (std::size_t t = 0; t < filled.values.size(); ++t)
    ASSERT_EQ(filled.values[t], t < mesh.triangles.size() ? 0.0 : 1.0);
  EXPECT_EQ(result.filling.triangles, filled.values.size() - mesh.triangles.size());
  // Triangles have about the size of those around the hole.
  EXPECT_GT(result.filling.triangles, 50U);
  EXPECT_LT(result.filling.triangles, 600U);
  const MeshReport report = report_mesh(result.mesh);
  ASSERT_EQ(report.boundaries.size(), 1U);
  EXPECT_NEAR(report.boundaries[0].length_m, 4.8, 1e-12);
}

TEST(HoleFilling, ValuesOfNewVerticesComeFromTheBoundary) {
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
  // Face fields are copied from a triangle at the hole.
  const auto& number = field_of(result.mesh.face_fields, "number").values;
  for (std::size_t t = mesh.triangles.size(); t < number.size(); ++t) {
    const auto& corners = whole.triangles[static_cast<std::size_t>(number[t])];
    EXPECT_NEAR(whole.vertices[corners[0]].norm(), 0.15, 0.05);
  }
}

// The patch continues the tangent planes of the surface.
TEST(HoleFilling, HoleInABallIsFilledRound) {
  const TriangleMesh ball = geodesic_mesh(5, 1.0);
  const TriangleMesh mesh = kept_where(ball, [](const Eigen::Vector3d& p) { return p.z() < 0.9; });
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(0.95));
  EXPECT_EQ(result.filling.holes, 1U);
  const MeshReport report = report_mesh(result.mesh);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_EQ(report.genus, 0);
  double lowest = 1.0;
  double highest = 1.0;
  for (const Eigen::Vector3d& v : result.mesh.vertices) {
    lowest = std::min(lowest, v.norm());
    highest = std::max(highest, v.norm());
  }
  // A flat patch would be 0.1 below the ball.
  EXPECT_GT(lowest, 0.97);
  EXPECT_LT(highest, 1.03);
  EXPECT_NEAR(report.volume_m3, libmap::signed_volume(ball), 0.01 * libmap::signed_volume(ball));
}

TEST(HoleFilling, OuterBoundariesAreNeverFilled) {
  // All holes are smaller than the allowed diameter.
  const MeshCleaningOptions options = holes_up_to(10.0);
  for (const TriangleMesh& open :
       {terrain_mesh(20, 1.0, [](double x, double y) { return x * y; }),
        kept_where(geodesic_mesh(4, 1.0), [](const Eigen::Vector3d&p) { return p.z() > 0.0; }),
        graspmap_test::grid_mesh(
            4, 30, graspmap_test::Seam::open, graspmap_test::Seam::open,
            [](double u, double v) { return Eigen::Vector3d(v, 0.1 * u, 0); })}) {
    const MeshCleaningResult result = cleaned(open, options);
    EXPECT_EQ(result.filling.holes, 0U);
    EXPECT_TRUE(same_geometry(result.mesh, open));
  }
  // The inner boundary of a ring is filled; the outer one stays open.
  const TriangleMesh ring = graspmap_test::grid_mesh(
      3, 40, graspmap_test::Seam::open, graspmap_test::Seam::closed, [](double u, double v) {
        const double r = 1.0 + 0.3 * u;
        return Eigen::Vector3d(r * std::cos(2 * pi * v), r * std::sin(2 * pi * v), 0);
      });
  const MeshCleaningResult result = cleaned(ring, options);
  EXPECT_EQ(result.filling.holes, 1U);
  ASSERT_EQ(report_mesh(result.mesh).boundaries.size(), 1U);
  EXPECT_NEAR(report_mesh(result.mesh).boundaries[0].length_m, 2 * pi * 1.3, 0.02);
}

TEST(HoleFilling, LongTubeIsClosedAtItsEnds) {
  const TriangleMesh tube = graspmap_test::cylinder_mesh(60, 24, 0.1, 1.5);
  const MeshCleaningResult result = cleaned(tube, holes_up_to(0.25));
  EXPECT_EQ(result.filling.holes, 2U);
  EXPECT_TRUE(report_mesh(result.mesh).is_watertight());
}

// A patch of this hole would intersect the needle in it.
TEST(HoleFilling, PatchesMeetNothingElse) {
  TriangleMesh mesh = kept_where(terrain_mesh(40, 1.0, [](double, double) { return 0.0; }),
                                 [](const Eigen::Vector3d& p) { return p.norm() > 0.1; });
  const double area = libmap::surface_area(mesh);
  mesh = graspmap_test::join_meshes(mesh, graspmap_test::cylinder_mesh(20, 12, 0.02, 0.5));
  for (std::size_t v = mesh.vertices.size() - 21 * 12; v < mesh.vertices.size(); ++v)
    mesh.vertices[v].z() -= 0.25;
  const MeshCleaningResult result = cleaned(mesh, holes_up_to(0.3));
  EXPECT_EQ(result.filling.unfilled, 1U);
  EXPECT_EQ(result.filling.holes, 2U);  // the tube's ends
  EXPECT_GT(libmap::surface_area(result.mesh), area);
}

}  // namespace hole_filling_test
