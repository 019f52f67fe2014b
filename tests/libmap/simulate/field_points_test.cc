// Field points on bodies with known flat faces, edges and corners.
#include "libmap/simulate/field_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "libmap/core/parallel.h"
#include "libmap/scenes/solid.h"
#include "libmap/simulate/rock_site.h"
#include "libmap/simulate/site_mesh.h"
#include "tests/libmap/scenes/scene_test_support.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace field_points_test {

using graspmap_test::error_of;
using graspmap_test::is_error;

RockSite flat_site(int rocks, int count) {
  RockSite site;
  site.ground.relief_m = 0.0;
  site.rocks.resize(static_cast<std::size_t>(rocks));
  site.field_points.count = count;
  return site;
}

std::vector<HalfSpace> box_planes(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  std::vector<HalfSpace> planes;
  for (int axis = 0; axis < 3; ++axis) {
    planes.push_back({Eigen::Vector3d::Unit(axis), high[axis]});
    planes.push_back({-Eigen::Vector3d::Unit(axis), -low[axis]});
  }
  return planes;
}

void append(TriangleMesh& mesh, const Solid& solid, int rock) {
  if (mesh.face_fields.empty()) mesh.face_fields.push_back({"rock", ScalarType::int32, {}});
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), solid.vertices.begin(), solid.vertices.end());
  for (const Triangle& t : solid.triangles)
    mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  mesh.face_fields[0].values.resize(mesh.triangles.size(), rock);
}

TEST(FieldPoints, KnowFlatsEdgesAndCornersOfABox) {
  const Eigen::Vector3d low(-0.3, -0.25, -0.1);
  const Eigen::Vector3d high(0.3, 0.25, 0.5);
  TriangleMesh mesh;
  append(mesh, refine_facets(convex_solid(box_planes(low, high), 2.0), 0.01), 1);
  RockSite site = flat_site(1, 60);
  site.field_points.min_height_m = 0.15;
  const std::vector<FieldPoint> points = choose_field_points(site, mesh);
  ASSERT_EQ(points.size(), 60U);
  std::map<LocationKind, int> kinds;
  for (const FieldPoint& point : points) {
    ++kinds[point.kind];
    EXPECT_GE(point.position.z(), 0.15);
    EXPECT_NEAR(point.height_m, point.position.z(), 1e-12);
    // Distances to the nearest walls and to the top, in order.
    std::vector<double> distances = {0.3 - std::abs(point.position.x()),
                                     0.25 - std::abs(point.position.y()), 0.5 - point.position.z()};
    std::sort(distances.begin(), distances.end());
    EXPECT_NEAR(distances[0], 0.0, 1e-12);
    const double radius = site.field_points.radius_m;
    if (point.kind == LocationKind::flat) {
      EXPECT_GT(distances[1], 0.5 * radius);
    }
    if (point.kind == LocationKind::edge) {
      EXPECT_LT(distances[1], radius);
    }
    if (point.kind == LocationKind::edge) {
      EXPECT_GT(distances[2], 0.4 * radius);
    }
    if (point.kind == LocationKind::corner) {
      EXPECT_LT(distances[2], radius);
    }
    EXPECT_NE(point.kind, LocationKind::irregular);
    EXPECT_EQ(point.is_hard, point.slope_deg > 60.0);
  }
  EXPECT_GE(kinds[LocationKind::flat], 10);
  EXPECT_GE(kinds[LocationKind::edge], 10);
  EXPECT_GE(kinds[LocationKind::corner], 4);
}

TEST(FieldPoints, WhereTheSurfaceBendsInwardIsIrregular) {
  // An L: the step between its two boxes.
  const Solid step = refine_facets(
      unite({convex_solid(box_planes({-0.3, -0.2, -0.1}, {0.3, 0.2, 0.3}), 2.0),
             [] {
               Solid upper = convex_solid(box_planes({-0.29, -0.19, 0.1}, {0.0, 0.19, 0.6}), 2.0);
               for (int& label : upper.labels) label += 100;
               return upper;
             }()}),
      0.01);
  TriangleMesh mesh;
  append(mesh, step, 1);
  RockSite site = flat_site(1, 40);
  site.field_points.min_height_m = 0.12;
  int irregular = 0;
  for (const FieldPoint& point : choose_field_points(site, mesh)) {
    if (point.kind != LocationKind::irregular) continue;
    ++irregular;
    // Near the rim along which the upper box stands on the lower one.
    EXPECT_LT(std::abs(point.position.z() - 0.3), 0.04);
  }
  EXPECT_GE(irregular, 3);
}

TEST(FieldPoints, SpreadOverRocksAndKeepApart) {
  const RockSite site = graspmap_test::shipped_site("rocks.yaml");
  const TriangleMesh mesh = site_mesh(site, {.edge_length_m = 0.015});
  const std::vector<FieldPoint> points = choose_field_points(site, mesh);
  ASSERT_EQ(points.size(), 30U);
  std::map<int, int> rocks;
  std::map<LocationKind, int> kinds;
  std::map<bool, int> hard;
  for (std::size_t n = 0; n < points.size(); ++n) {
    ++rocks[points[n].rock];
    ++kinds[points[n].kind];
    ++hard[points[n].is_hard];
    EXPECT_GE(points[n].height_m, site.field_points.min_height_m);
    EXPECT_TRUE(std::find(mesh.vertices.begin(), mesh.vertices.end(), points[n].position) !=
                mesh.vertices.end());
    for (std::size_t other = 0; other < n; ++other)
      EXPECT_GE((points[n].position - points[other].position).norm(), site.field_points.radius_m);
  }
  EXPECT_EQ(rocks.size(), 12U);
  for (const auto& [rock, count] : rocks) EXPECT_LE(count, 3);
  EXPECT_EQ(kinds.size(), 4U);
  for (const auto& [kind, count] : kinds) EXPECT_GE(count, 5) << location_kind_name(kind);
  EXPECT_GE(hard[true], 8);
  EXPECT_GE(hard[false], 8);
  const ThreadLimit one(1);
  const std::vector<FieldPoint> again = choose_field_points(site, mesh);
  for (std::size_t n = 0; n < points.size(); ++n) EXPECT_EQ(points[n].position, again[n].position);
}

TEST(FieldPoints, TheTableNamesPlacesAndCarriesNoVerdict) {
  RockSite site = flat_site(2, 2);
  site.rocks[0].name = "R01";
  FieldPoint point;
  point.position = {0.12345, -1.0, 0.5};
  FieldPoint second = point;
  second.rock = 1;
  second.kind = LocationKind::corner;
  second.is_hard = true;
  const Table table = field_point_table(site, {point, second});
  EXPECT_FALSE(table.find_column("graspable"));
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.rows[0][table.column("place")], "P01");
  EXPECT_EQ(table.rows[0][table.column("rock")], "R01");
  EXPECT_EQ(table.rows[0][table.column("difficulty")], "easy");
  EXPECT_EQ(table.rows[1][table.column("kind")], "corner");
  EXPECT_EQ(table.rows[1][table.column("difficulty")], "hard");
  EXPECT_EQ(table.rows[1][table.column("rock")], "2");
  EXPECT_NEAR(table.number(0, table.column("x")), 0.12345, 6e-5);
}

TEST(FieldPoints, TooFewPlacesIsAnError) {
  TriangleMesh mesh;
  append(mesh,
         refine_facets(convex_solid(box_planes({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.2}), 2.0), 0.01),
         1);
  EXPECT_TRUE(is_error(error_of([&] { choose_field_points(flat_site(1, 5000), mesh); }),
                       {.field = "field_points.count", .value = "5000"}));
  mesh.face_fields.clear();
  EXPECT_EQ(error_of([&] { choose_field_points(flat_site(1, 5), mesh); }).context().field, "rock");
}

}  // namespace field_points_test
}  // namespace libmap
