#include "libmap/mesh/surface_distance.h"
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_distance_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;

// A bumpy square of 2 m about `center`, (n - 1)^2 * 2 triangles.
TriangleMesh bumpy(std::uint32_t n, const Eigen::Vector3d& center = Eigen::Vector3d::Zero()) {
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const double u = 2.0 * x / (n - 1) - 1;
      const double v = 2.0 * y / (n - 1) - 1;
      mesh.vertices.push_back(center +
                              Eigen::Vector3d(u, v, 0.2 * std::sin(5 * u) * std::cos(4 * v)));
    }
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t a = y * n + x;
      mesh.triangles.push_back({a, a + 1, a + n});
      mesh.triangles.push_back({a + 1, a + n + 1, a + n});
    }
  return mesh;
}

TriangleMesh unit_square() {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

Eigen::Vector3d random_point(double half) {
  return {uniform(-half, half), uniform(-half, half), uniform(-half, half)};
}

TEST(SurfaceDistance, FacesEdgesAndCornersInClosedForm) {
  const SurfaceDistance surface(unit_square());
  EXPECT_DOUBLE_EQ(surface.nearest({0.3, 0.6, -0.25}).distance_m, 0.25);
  EXPECT_DOUBLE_EQ(surface.nearest({0.3, -0.3, 0.4}).distance_m, 0.5);
  EXPECT_DOUBLE_EQ(surface.nearest({3, 3, 1}).distance_m, 3);
  EXPECT_EQ(surface.nearest({3, 3, 1}).position, Eigen::Vector3d(1, 1, 0));
  EXPECT_DOUBLE_EQ(surface.nearest({0.5, 0.5, 0}).distance_m, 0);
  EXPECT_EQ(surface.nearest({0.9, 0.1, 0.1}).triangle, 0U);
  EXPECT_EQ(surface.nearest({0.1, 0.9, 0.1}).triangle, 1U);
}

TEST(SurfaceDistance, NearestOnATriangleIsNoFurtherThanAnyOfItsPoints) {
  for (int round = 0; round < 300; ++round) {
    const Eigen::Vector3d a = random_point(1);
    const Eigen::Vector3d b = random_point(1);
    const Eigen::Vector3d c = random_point(1);
    const Eigen::Vector3d point = random_point(2);
    const Eigen::Vector3d nearest = nearest_on_triangle(point, a, b, c);
    // The point is in the triangle if its three sub-areas add up to the area.
    const double whole = (b - a).cross(c - a).norm();
    const double parts = (a - nearest).cross(b - nearest).norm() +
                         (b - nearest).cross(c - nearest).norm() +
                         (c - nearest).cross(a - nearest).norm();
    ASSERT_NEAR(parts, whole, 1e-9);
    double best = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= 40; ++i)
      for (int j = 0; i + j <= 40; ++j)
        best = std::min(best, (a + i / 40.0 * (b - a) + j / 40.0 * (c - a) - point).norm());
    ASSERT_LE((nearest - point).norm(), best + 1e-12);
    ASSERT_GE((nearest - point).norm(), best - 0.1);
  }
}

TEST(SurfaceDistance, DegenerateTrianglesAreSegmentsAndPoints) {
  const Eigen::Vector3d o(0, 0, 0);
  const Eigen::Vector3d x(1, 0, 0);
  for (const auto& corners : {std::array{o, x, x}, std::array{o, o, x}, std::array{x, o, x},
                              std::array{o, x, Eigen::Vector3d(0.5, 0, 0)}}) {
    const Eigen::Vector3d nearest =
        nearest_on_triangle({0.75, 2, 0}, corners[0], corners[1], corners[2]);
    EXPECT_LT((nearest - Eigen::Vector3d(0.75, 0, 0)).norm(), 1e-12);
  }
  EXPECT_EQ(nearest_on_triangle({3, 4, 0}, o, o, o), o);
}

TEST(SurfaceDistance, AgreesWithASearchOfAllTriangles) {
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(4e5, -3e6, 70)}) {
    const TriangleMesh mesh = bumpy(25, center);
    const SurfaceDistance surface(mesh);
    for (int round = 0; round < 300; ++round) {
      const Eigen::Vector3d point = center + random_point(round % 3 == 0 ? 10 : 1.2);
      double best = std::numeric_limits<double>::infinity();
      for (const Triangle& t : mesh.triangles)
        best = std::min(best, (nearest_on_triangle(point, mesh.vertices[t[0]], mesh.vertices[t[1]],
                                                   mesh.vertices[t[2]]) -
                               point)
                                  .norm());
      const SurfacePoint found = surface.nearest(point);
      ASSERT_NEAR(found.distance_m, best, 1e-8);
      ASSERT_NEAR((found.position - point).norm(), best, 1e-8);
    }
  }
}

TEST(SurfaceDistance, MeshesThatCannotBe) {
  EXPECT_TRUE(is_error(error_of([] { SurfaceDistance({}); }), {.field = "triangles of the mesh"}));
  TriangleMesh mesh = unit_square();
  mesh.triangles[0][1] = 9;
  EXPECT_TRUE(is_error(error_of([&] { SurfaceDistance{mesh}; }),
                       {.field = "vertex of triangle 0", .value = "9", .bound = "< 4"}));
  mesh = unit_square();
  mesh.vertices[2].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      is_error(error_of([&] { SurfaceDistance{mesh}; }), {.field = "vertices of the mesh"}));
}

TEST(SurfaceDistance, Statistics) {
  std::vector<double> distances;
  for (int n = 100; n >= 1; --n) distances.push_back(0.001 * n);
  const DistanceStatistics statistics = distance_statistics(distances);
  EXPECT_EQ(statistics.count, 100U);
  EXPECT_NEAR(statistics.mean_m, 0.0505, 1e-12);
  EXPECT_NEAR(statistics.median_m, 0.0505, 1e-12);
  EXPECT_NEAR(statistics.p95_m, 0.095, 1e-12);
  EXPECT_NEAR(statistics.max_m, 0.1, 1e-12);
  EXPECT_NEAR(statistics.rmse_m, 0.001 * std::sqrt(101.0 * 201.0 / 6.0), 1e-12);
  EXPECT_EQ(distance_statistics({}).count, 0U);
  EXPECT_EQ(distance_statistics({0.3}).p95_m, 0.3);
}

TEST(SurfaceDistance, SamplesAreSpreadByArea) {
  TriangleMesh mesh = unit_square();
  mesh.vertices[3] = {0, 3, 0};  // the second triangle has three times the area of the first
  const auto samples = sample_surface(mesh, 4000, 7);
  EXPECT_EQ(samples.size(), 8000U);
  std::size_t second = 0;
  const SurfaceDistance surface(mesh);
  for (const SurfacePoint& sample : samples) {
    second += sample.triangle == 1 ? 1 : 0;
    ASSERT_LT(surface.nearest(sample.position).distance_m, 1e-12);
  }
  EXPECT_NEAR(static_cast<double>(second), 6000, 2);
  EXPECT_NE(sample_surface(mesh, 4000, 8)[0].position, samples[0].position);
  EXPECT_EQ(sample_surface(mesh, 4000, 7)[77].position, samples[77].position);
  EXPECT_TRUE(is_error(error_of([&] { sample_surface(mesh, 1e12, 1); }),
                       {.field = "number of samples", .value = "2e+12 (1e+12 per m2)"}));
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  EXPECT_TRUE(is_error(error_of([&] { sample_surface(mesh, 10, 1); }), {.field = "mesh"}));
}

// The number of samples is limited for a few large triangles, and larger for a large mesh.
TEST(SurfaceDistance, SamplesOfFewTriangles) {
  TriangleMesh mesh = unit_square();
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex *= 60.0;
  const auto bound_of = [&] {
    return error_of([&] { sample_triangles(mesh, 1e9, 1); }).context().bound;
  };
  EXPECT_TRUE(is_error(error_of([&] { sample_triangles(mesh, 20000, 1); }),
                       {.field = "number of samples", .value = "7.2e+07 (20000 per m2)"}));
  EXPECT_EQ(bound_of(), "<= 2500000 for 2 triangles");
  mesh.triangles.resize(50000, mesh.triangles.front());
  EXPECT_EQ(bound_of(), "<= 5000000 for 50000 triangles");
  mesh.triangles.resize(1500000, mesh.triangles.front());
  EXPECT_EQ(bound_of(), "<= 100000000 for 1500000 triangles");
}

TEST(SurfaceDistance, CoverageAgreesWithASearchOfAllPoints) {
  std::vector<Eigen::Vector3d> samples;
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 1000; ++n) samples.push_back(random_point(1));
  for (int n = 0; n < 300; ++n) points.push_back(random_point(1));
  const std::vector<bool> flags = covered(samples, points, 0.15);
  for (std::size_t n = 0; n < samples.size(); ++n) {
    double best = 9;
    for (const Eigen::Vector3d& point : points) best = std::min(best, (point - samples[n]).norm());
    ASSERT_EQ(flags[n], best <= 0.15);
  }
  EXPECT_GT(fraction_of(flags), 0.1);
  EXPECT_LT(fraction_of(flags), 0.9);
  EXPECT_EQ(fraction_of(covered(samples, {}, 0.15)), 0.0);
  EXPECT_EQ(fraction_of({}), 0.0);
}

TEST(SurfaceDistance, ThreadsMakeNoDifference) {
  const TriangleMesh mesh = bumpy(40);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 5000; ++n) points.push_back(random_point(1));
  std::vector<std::vector<double>> results;
  for (const unsigned threads : {1U, 2U, 8U}) {
    const ThreadLimit limit(threads);
    results.push_back(distances_to_surface(points, mesh));
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

}  // namespace surface_distance_test
}  // namespace libmap
