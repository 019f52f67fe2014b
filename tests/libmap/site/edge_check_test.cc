#include "libmap/site/edge_check.h"
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace edge_check_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using graspmap_test::uniform;

const HeightFunction zero = [](const Eigen::Vector2d&) { return 0.0; };

void expect_near(const Eigen::Vector2d& actual, const Eigen::Vector2d& expected,
                 double tolerance = 1e-12) {
  EXPECT_LT((actual - expected).norm(), tolerance)
      << actual.transpose() << " is not " << expected.transpose();
}

TEST(EdgeCheck, PlacesGoRoundTheSiteFromItsLowerLeftCorner) {
  const EdgeCheckResult result = check_edges(corners_of({-1.5, -1}, {1.5, 2}), zero, zero,
                                             {.positions_per_edge = 3, .inset_m = 0.1});
  expect_near(result.edges[0][0].position, {-1.0, -0.9});
  expect_near(result.edges[0][2].position, {1.0, -0.9});
  expect_near(result.edges[1][0].position, {1.4, -0.5});
  expect_near(result.edges[1][1].position, {1.4, 0.5});
  expect_near(result.edges[2][0].position, {1.0, 1.9});
  expect_near(result.edges[3][2].position, {-1.4, -0.5});
  EXPECT_EQ(result.measured, 12U);
}

TEST(EdgeCheck, ErrorsOfATiltedPlaneInClosedForm) {
  // z = 0.01 x - 0.02 y + 0.001.
  TriangleMesh mesh = square_mesh(0.0, 2.0);
  for (Eigen::Vector3d& v : mesh.vertices) v.z() = 0.01 * v.x() - 0.02 * v.y() + 0.001;
  const EdgeCheckResult result =
      check_edges(corners_of({-1.5, -1.5}, {1.5, 1.5}), heights_of(mesh), zero);
  double sum = 0.0;
  double signed_sum = 0.0;
  for (std::size_t e = 0; e < 4; ++e) {
    ASSERT_EQ(result.edges[e].size(), 7U);
    double of_edge = 0.0;
    for (const EdgeCheckPoint& place : result.edges[e]) {
      const double truth = 0.01 * place.position.x() - 0.02 * place.position.y() + 0.001;
      ASSERT_TRUE(place.error_m());
      ASSERT_NEAR(*place.error_m(), truth, 1e-9);
      of_edge += std::abs(truth);
      signed_sum += truth;
    }
    EXPECT_NEAR(*result.mean_m[e], of_edge / 7, 1e-9);
    sum += of_edge;
  }
  EXPECT_NEAR(result.mean_abs_error_m, sum / 28, 1e-9);
  EXPECT_NEAR(result.mean_error_m, signed_sum / 28, 1e-9);
  EXPECT_NEAR(result.mean_error_m, 0.001, 1e-9) << "the rest is symmetric";
  // The extreme position of edge a or c in the direction of the slope.
  EXPECT_NEAR(result.max_abs_error_m, 0.01 * 1.5 * 6 / 7 + 0.02 * 1.45 + 0.001, 1e-9);
}

TEST(EdgeCheck, TruthIsTakenAtTheSamePlace) {
  TriangleMesh truth = square_mesh(0.0, 2.0);
  for (Eigen::Vector3d& v : truth.vertices) v.z() = 0.3 * v.x();
  TriangleMesh mesh = truth;
  for (Eigen::Vector3d& v : mesh.vertices) v.z() -= 0.004;
  const EdgeCheckResult result =
      check_edges(corners_of({-1, -1}, {1, 1}), heights_of(mesh), heights_of(truth));
  EXPECT_NEAR(result.mean_abs_error_m, 0.004, 1e-9);
  EXPECT_NEAR(result.mean_error_m, -0.004, 1e-9);
}

TEST(EdgeCheck, PlacesWithoutDataAreEmptyNotZero) {
  // Only x < 0 was measured.
  TriangleMesh mesh = square_mesh(0.002, 2.0);
  for (Eigen::Vector3d& v : mesh.vertices) v.x() = std::min(v.x(), 0.0);
  const EdgeCheckResult result =
      check_edges(corners_of({-1, -1}, {1, 1}), heights_of(mesh), zero, {.positions_per_edge = 4});
  EXPECT_EQ(result.measured, 8U);
  EXPECT_EQ(result.missing, 8U);
  EXPECT_FALSE(result.edges[1][0].height_m);
  EXPECT_FALSE(result.mean_m[1]);
  EXPECT_NEAR(*result.mean_m[0], 0.002, 1e-12);
  EXPECT_NEAR(result.mean_abs_error_m, 0.002, 1e-12) << "not diluted by what is missing";
  const HeightFunction nothing = [](const Eigen::Vector2d&) { return std::nullopt; };
  EXPECT_TRUE(is_error(error_of([&] {
                         check_edges(corners_of({-1, -1}, {1, 1}), nothing, zero);
                       }),
                       {.field = "positions"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         check_edges(corners_of({-1, -1}, {1, 1}), zero, nothing);
                       }),
                       {.field = "positions"}));
}

TEST(EdgeCheck, HeightsOfACloudAreMedians) {
  std::vector<Eigen::Vector3d> points = {{0, 0, 0.01}, {0.01, 0, 0.03}, {0, 0.01, 0.02},
                                         {0.03, 0, 9}, {0.015, 0, 5},   {1, 1, 0.5}};
  const HeightFunction four = heights_of(points, 0.02, 3);
  EXPECT_NEAR(*four({0, 0}), 0.025, 1e-12) << "0.01 0.02 0.03 5: the stray point does not pull";
  EXPECT_FALSE(four({1, 1})) << "one point alone";
  EXPECT_NEAR(*heights_of(points, 0.02, 1)({1, 1}), 0.5, 1e-12);
  EXPECT_FALSE(heights_of(points, 0.02, 1)({0.5, 0.5}));
  EXPECT_FALSE(heights_of({}, 0.02, 1)({0, 0}));
}

TEST(EdgeCheck, HeightsOfAMeshAreSeenFromAbove) {
  TriangleMesh mesh = graspmap_test::join_meshes(square_mesh(0.0), square_mesh(1.0, 0.5));
  EXPECT_NEAR(*heights_of(mesh)({0.1, 0.2}), 1.0, 1e-12);
  EXPECT_NEAR(*heights_of(mesh)({0.7, 0.2}), 0.0, 1e-12);
  EXPECT_NEAR(*heights_of(mesh, 0.8)({0.1, 0.2}), 0.0, 1e-12) << "from below the upper one";
  EXPECT_FALSE(heights_of(mesh)({1.2, 0.2}));
}

TEST(EdgeCheck, LeastRectangleOfATurnedSite) {
  for (const double degrees : {0.0, 12.0, -30.0, 44.0}) {
    const Eigen::Rotation2Dd turn(degrees * M_PI / 180);
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector2d& corner : {Eigen::Vector2d(-2, -1), Eigen::Vector2d(2, -1),
                                          Eigen::Vector2d(2, 1), Eigen::Vector2d(-2, 1)}) {
      const Eigen::Vector2d place = turn * corner + Eigen::Vector2d(5, 3);
      points.emplace_back(place.x(), place.y(), uniform(0, 1));
    }
    for (int n = 0; n < 200; ++n) {
      const Eigen::Vector2d place =
          turn * Eigen::Vector2d(uniform(-2, 2), uniform(-1, 1)) + Eigen::Vector2d(5, 3);
      points.emplace_back(place.x(), place.y(), 0.0);
    }
    const SiteCorners site = bounding_corners(points, true);
    expect_near(site.corners[0], turn * Eigen::Vector2d(-2, -1) + Eigen::Vector2d(5, 3), 1e-9);
    expect_near(site.corners[1], turn * Eigen::Vector2d(2, -1) + Eigen::Vector2d(5, 3), 1e-9);
    expect_near(site.corners[3], turn * Eigen::Vector2d(-2, 1) + Eigen::Vector2d(5, 3), 1e-9);
    const SiteCorners axes = bounding_corners(points, false);
    const Bounds3d bounds = bounds_of(points);
    expect_near(axes.corners[0], bounds.min.head<2>());
    expect_near(axes.corners[2], bounds.max.head<2>());
  }
}

TEST(EdgeCheck, SitesThatCannotBe) {
  EXPECT_TRUE(is_error(error_of([] { bounding_corners({}, false); }), {.field = "points"}));
  for (const bool turned : {false, true}) {
    EXPECT_TRUE(is_error(error_of([&] {
                           bounding_corners({{1, 2, 3}}, turned);
                         }),
                         {.field = "width and depth", .bound = "> 0"}));
    EXPECT_TRUE(is_error(error_of([&] {
                           bounding_corners({{0, 0, 3}, {1, 0, 3}, {2, 0, 1}}, turned);
                         }),
                         {.field = "width and depth", .bound = "> 0"}));
  }
  const SiteCorners site = corners_of({0, 0}, {1, 2});
  EXPECT_TRUE(is_error(error_of([&] { check_edges(site, zero, zero, {.inset_m = 0.5}); }),
                       {.field = "inset_m", .value = "0.5"}));
  EXPECT_TRUE(
      is_error(error_of([&] { check_edges(site, zero, zero, {.positions_per_edge = 0}); }),
               {.field = "positions_per_edge", .value = "0", .bound = ">= 1 and <= 10000"}));
  EXPECT_TRUE(is_error(error_of([&] { check_edges(site, zero, zero, {.inset_m = NAN}); }),
                       {.field = "inset_m", .value = "nan", .bound = ">= 0"}));
}

}  // namespace edge_check_test
}  // namespace libmap
