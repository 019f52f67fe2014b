#include "libgtd/shape/surface_normal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace libgtd {
namespace surface_normal_test {

using Eigen::Vector3d;
using Eigen::Vector3f;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libmap::PointCloud;

PointCloud plane_through_origin(const Vector3d& normal) {
  PointCloud cloud;
  const Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
  for (int n = 0; n < 2000; ++n)
    cloud.positions.push_back(uniform(-0.2, 0.2) * u + uniform(-0.2, 0.2) * v);
  return cloud;
}

TEST(SurfaceNormal, IsThatOfAPlaneOnTheSideThatIsAsked) {
  for (int n = 0; n < 50; ++n) {
    const Vector3d normal =
        Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized().eval();
    const PointCloud cloud = plane_through_origin(normal);
    const Vector3d aside = normal + 0.5 * normal.unitOrthogonal();
    const auto found = fit_surface_normals(cloud, {Vector3d::Zero(), {0.01, 0, 0}},
                                           {aside.cast<float>(), Vector3f(-aside.cast<float>())},
                                           {.radius_m = 0.07});
    EXPECT_TRUE(found[0].normal.cast<double>().isApprox(normal, 1e-6));
    EXPECT_TRUE(found[1].normal.cast<double>().isApprox(-normal, 1e-6));
    const double slope = std::acos(normal.z()) * 180.0 / std::numbers::pi;
    EXPECT_NEAR(found[0].slope_deg, slope, 1e-3);
    EXPECT_NEAR(found[1].slope_deg, 180.0 - slope, 1e-3);
  }
}

TEST(SurfaceNormal, FacesUpWithoutAnOutsideAndIsNoneOnAVerticalWall) {
  const Vector3d leaning = Vector3d(1, 0, -0.2).normalized();
  const auto found = fit_surface_normals(plane_through_origin(leaning), {Vector3d::Zero()}, {},
                                         {.radius_m = 0.07});
  EXPECT_TRUE(found[0].normal.cast<double>().isApprox(-leaning, 1e-6));
  const auto wall = fit_surface_normals(plane_through_origin(Vector3d::UnitX()), {Vector3d::Zero()},
                                        {Vector3f::Zero()}, {.radius_m = 0.07});
  EXPECT_FALSE(wall[0].normal.allFinite());
  EXPECT_NEAR(wall[0].slope_deg, 90.0, 1e-3);
}

TEST(SurfaceNormal, IsNoneWhereThereIsNoPlane) {
  PointCloud line, lump, pair;
  for (int n = 0; n < 100; ++n) {
    line.positions.emplace_back(0.001 * n, 0, 0);
    lump.positions.emplace_back(uniform(-0.02, 0.02), uniform(-0.02, 0.02), uniform(-0.02, 0.02));
  }
  pair.positions = {{0, 0, 0}, {0.01, 0, 0}};
  for (const PointCloud& cloud : {line, lump, pair, PointCloud{}}) {
    const auto found = fit_surface_normals(cloud, {Vector3d::Zero()}, {}, {.radius_m = 0.07});
    EXPECT_FALSE(found[0].normal.allFinite());
    EXPECT_TRUE(std::isnan(found[0].slope_deg));
  }
}

TEST(SurfaceNormal, IsTheRadiusOfABall) {
  PointCloud ball;
  for (int n = 0; n < 20000; ++n) {
    Vector3d way(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    if (way.norm() > 1 || way.norm() < 0.1) continue;
    ball.positions.push_back(0.3 * way.normalized());
  }
  std::vector<Vector3d> coordinates;
  std::vector<Vector3f> outsides;
  for (std::size_t n = 0; n < ball.size(); n += 50) {
    coordinates.push_back(ball.positions[n]);
    outsides.push_back(ball.positions[n].cast<float>());
  }
  const auto found = fit_surface_normals(ball, coordinates, outsides, {.radius_m = 0.07});
  for (std::size_t n = 0; n < coordinates.size(); ++n)
    EXPECT_GT(found[n].normal.cast<double>().dot(coordinates[n].normalized()), std::cos(0.03));
}

TEST(SurfaceNormal, DependsOnNothingFartherOff) {
  PointCloud cloud = plane_through_origin(Vector3d(0.3, 0.1, 0.9).normalized());
  const auto expected = fit_surface_normals(cloud, {Vector3d::Zero()}, {}, {.radius_m = 0.05});
  for (int n = 0; n < 500; ++n)
    cloud.positions.push_back(
        uniform(0.0501, 0.2) *
        Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized());
  const libmap::ThreadLimit limit(3);
  const auto found =
      fit_surface_normals(cloud, {{0.03, 0, 0}, Vector3d::Zero()}, {}, {.radius_m = 0.05});
  EXPECT_EQ(found[1].normal, expected[0].normal);
  EXPECT_EQ(found[1].slope_deg, expected[0].slope_deg);
}

TEST(SurfaceNormal, RefusesWhatItCannotUse) {
  const PointCloud cloud = plane_through_origin(Vector3d::UnitZ());
  EXPECT_TRUE(is_error(error_of([&] { fit_surface_normals(cloud, {}, {}, {.radius_m = 0.0}); }),
                       {.field = "radius_m", .value = "0"}));
  EXPECT_TRUE(
      is_error(error_of([&] { fit_surface_normals(cloud, {}, {}, {.up = Vector3d::Zero()}); }),
               {.field = "up"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         fit_surface_normals(cloud, {Vector3d::Zero()}, {{}, {}}, {});
                       }),
                       {.field = "outsides", .value = "2", .bound = "1"}));
}

}  // namespace surface_normal_test
}  // namespace libgtd
