#include "libgtd/terrain/planar_delaunay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace planar_delaunay_test {

using Eigen::Vector3d;
using graspmap_test::uniform;
using libgtd::PlanarTriangulation;
using libgtd::triangulate_in_plane;
using Points = std::vector<Vector3d>;
using Corner = std::pair<double, double>;
using Triangles = std::vector<std::array<Corner, 3>>;

// Sorted by position, so that the order of the points has no effect.
Triangles triangles_of(const Points& points) {
  Triangles triangles;
  for (const auto& corners : triangulate_in_plane(points).triangles) {
    std::array<Corner, 3> one;
    for (std::size_t a = 0; a < 3; ++a) one[a] = {points[corners[a]].x(), points[corners[a]].y()};
    EXPECT_EQ(one[0], *std::min_element(one.begin(), one.end()));
    triangles.push_back(one);
  }
  std::sort(triangles.begin(), triangles.end());
  EXPECT_EQ(std::adjacent_find(triangles.begin(), triangles.end()), triangles.end());
  return triangles;
}

Points scattered(std::size_t count) {
  Points points;
  for (std::size_t n = 0; n < count; ++n)
    points.emplace_back(uniform(0, 3), uniform(0, 2), uniform(0, 1));
  return points;
}

// The four points of every square are cocircular.
Points lattice(int columns, int rows) {
  Points points;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) points.emplace_back(0.5 * i, 0.5 * j, 0);
  return points;
}

void expect_same_in_any_order(Points points) {
  const Triangles expected = triangles_of(points);
  std::mt19937 random(7);
  for (int round = 0; round < 5; ++round) {
    std::shuffle(points.begin(), points.end(), random);
    ASSERT_EQ(triangles_of(points), expected) << round;
  }
}

// Twice the area, and a test whether `p` is inside the circle of a, b, c (counterclockwise).
double area_of(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}
double in_circle(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& p) {
  Eigen::Matrix3d m;
  int row = 0;
  for (const Vector3d* const corner : {&a, &b, &c}) {
    const double x = corner->x() - p.x(), y = corner->y() - p.y();
    m.row(row++) << x, y, x * x + y * y;
  }
  return m.determinant();
}

// Tests every point against every triangle.
TEST(PlanarDelaunay, NoPointLiesInATrianglesCircumcircleAndTheHullIsFilled) {
  const Points points = scattered(300);
  const PlanarTriangulation made = triangulate_in_plane(points);
  EXPECT_EQ(made.vertices, points.size());
  std::set<std::uint32_t> used;
  double area = 0;
  for (const auto& [a, b, c] : made.triangles) {
    EXPECT_GT(area_of(points[a], points[b], points[c]), 0);
    area += area_of(points[a], points[b], points[c]);
    used.insert({a, b, c});
    for (const Vector3d& p : points)
      EXPECT_LT(in_circle(points[a], points[b], points[c], p), 1e-12);
  }
  EXPECT_EQ(used.size(), points.size());
  // Hull by gift wrapping.
  std::size_t at = 0;
  for (std::size_t n = 0; n < points.size(); ++n)
    if (points[n].x() < points[at].x()) at = n;
  const std::size_t first = at;
  double hull = 0;
  do {
    std::size_t next = at == 0 ? 1 : 0;
    for (std::size_t n = 0; n < points.size(); ++n)
      if (n != at && area_of(points[at], points[next], points[n]) < 0) next = n;
    hull += area_of(points[first], points[at], points[next]);
    at = next;
  } while (at != first);
  EXPECT_NEAR(area, hull, 1e-12);
}

TEST(PlanarDelaunay, OrderDoesNotMatter) {
  expect_same_in_any_order(scattered(2000));
  for (int round = 0; round < 20; ++round) expect_same_in_any_order(scattered(40));
}

TEST(PlanarDelaunay, OrderDoesNotMatterWherePointsLieOnOneCircle) {
  expect_same_in_any_order(lattice(30, 20));
  expect_same_in_any_order(lattice(3, 400));
  expect_same_in_any_order(lattice(200, 2));
  Points circle;
  for (int n = 0; n < 256; ++n)
    circle.emplace_back(std::cos(n * M_PI / 128), std::sin(n * M_PI / 128), 0);
  for (const auto& [x, y] : {std::pair(3, 4), {4, 3}, {5, 0}, {0, 5}, {-3, 4}, {-4, -3}, {0, -5}})
    circle.emplace_back(x, y, 0);  // exactly cocircular
  expect_same_in_any_order(circle);
}

TEST(PlanarDelaunay, OrderDoesNotMatterInAwkwardClouds) {
  Points narrow = scattered(500);
  for (Vector3d& point : narrow) point.x() *= 1e-7;
  expect_same_in_any_order(narrow);
  for (Vector3d& point : narrow) point = {point.y(), 1e-9 * point.x(), 0};
  expect_same_in_any_order(narrow);
  Points far = scattered(500);
  for (Vector3d& point : far) point += Vector3d(4e6, -7e5, 0);
  expect_same_in_any_order(far);
  Points clusters;  // without points between them
  for (int n = 0; n < 600; ++n)
    clusters.emplace_back(uniform(0, 0.01) + n % 3, uniform(0, 1) * (n % 2), 0);
  expect_same_in_any_order(clusters);
  Points columns = lattice(4, 100);  // one line each, without final triangles
  columns.emplace_back(100, 3, 0);
  expect_same_in_any_order(columns);
}

TEST(PlanarDelaunay, OfPointsInOnePlaceTheHighestIsACorner) {
  Points points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  for (const double z : {-1.0, 2.0, 1.0}) points.emplace_back(0.25, 0.5, z);
  const PlanarTriangulation made = triangulate_in_plane(points);
  EXPECT_EQ(made.vertices, 5u);
  EXPECT_EQ(made.triangles.size(), 4u);
  for (const auto& corners : made.triangles)
    for (const std::uint32_t corner : corners) EXPECT_TRUE(corner < 4 || corner == 5);
}

TEST(PlanarDelaunay, PointsOnALineHaveNoTriangles) {
  EXPECT_TRUE(triangulate_in_plane({}).triangles.empty());
  EXPECT_TRUE(triangulate_in_plane({{1, 2, 3}, {4, 5, 6}}).triangles.empty());
  EXPECT_TRUE(triangulate_in_plane(Points(50, Vector3d(1, 2, 3))).triangles.empty());
  EXPECT_TRUE(triangulate_in_plane(lattice(1, 40)).triangles.empty());
  EXPECT_TRUE(triangulate_in_plane(lattice(40, 1)).triangles.empty());
}

TEST(PlanarDelaunay, OrderDoesNotMatterInRealTerrain) {
  GRASPMAP_REQUIRE_DATA();
  for (const char* name : {"leaning_bouldering_holds.pcd", "artificial_rocks.pcd"}) {
    SCOPED_TRACE(name);
    expect_same_in_any_order(
        libmap::read_cloud(graspmap_test::data_folder() / "clouds" / name).cloud.positions);
  }
}

}  // namespace planar_delaunay_test
