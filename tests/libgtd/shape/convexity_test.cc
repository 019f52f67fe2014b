#include "libgtd/shape/convexity.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace convexity_test {

using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::uniform;
using libgtd::Curvature;
using libgtd::CurvatureMethod;
using libgtd::CurvatureOptions;
using libgtd::CurvatureResult;
using libgtd::find_convex;
using libgtd::mark_near_convex;
using libmap::PointCloud;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Curvature bent(float k1, float k2) {
  Curvature c;
  c.k1 = k1;
  c.k2 = k2;
  c.valid = true;
  return c;
}

// Plain with a hill (y > 0) and a hollow (y < 0), both of a ball of radius 0.25.
PointCloud hill_and_hollow() {
  PointCloud cloud;
  for (int i = 0; i < 12000; ++i) {
    const double x = uniform(-0.5, 0.5), y = uniform(-1, 1);
    const double r2 = x * x + (std::abs(y) - 0.5) * (std::abs(y) - 0.5);
    const double bump = r2 < 0.04 ? std::sqrt(0.0625 - r2) - 0.15 : 0;
    cloud.positions.emplace_back(x + 3, y, (y > 0 ? bump : -bump) + 1);
  }
  return cloud;
}

double distance_to_top(const Vector3d& p, double y) { return std::hypot(p.x() - 3, p.y() - y); }

TEST(Convexity, BothHalvesOfAHillAreConvexAndAHollowIsNot) {
  const PointCloud cloud = hill_and_hollow();
  const auto convex = find_convex(libgtd::estimate_curvature(cloud), cloud.positions);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vector3d& p = cloud.positions[i];
    if (distance_to_top(p, 0.5) < 0.1) {
      ASSERT_EQ(convex[i], 1) << p.transpose();
    }
    if (distance_to_top(p, -0.5) < 0.1) {
      ASSERT_EQ(convex[i], 0) << p.transpose();
    }
    if (distance_to_top(p, 0.5) > 0.3 && distance_to_top(p, -0.5) > 0.3) {
      ASSERT_EQ(convex[i], 0) << p.transpose();
    }
  }
}

TEST(Convexity, ThesisTakesTheHollowForConvexToo) {
  const PointCloud cloud = hill_and_hollow();
  CurvatureOptions options;
  options.method = CurvatureMethod::thesis;
  const auto convex = find_convex(libgtd::estimate_curvature(cloud, options), cloud.positions);
  std::size_t hollow = 0, found = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (distance_to_top(cloud.positions[i], -0.5) > 0.1) continue;
    ++hollow;
    found += convex[i];
  }
  EXPECT_GT(hollow, 100u);
  EXPECT_GT(found, hollow / 2);  // at the rim the normals of hollow and plain mix
}

TEST(Convexity, RuleOfEachMethod) {
  CurvatureResult result;
  result.radius_m = 0.1;
  result.points = {bent(3, 2), bent(3, 1), bent(3, 0.5F), bent(-2, -3), bent(2, -2), {}};
  std::vector<Vector3d> positions(6, Vector3d(0, 0, 1));
  using testing::ElementsAre;
  EXPECT_THAT(find_convex(result, positions), ElementsAre(1, 0, 0, 0, 0, 0));
  EXPECT_THAT(find_convex(result, positions, {.min_curvature_per_m = 0.4}),
              ElementsAre(1, 1, 1, 0, 0, 0));

  result.method = CurvatureMethod::thesis;
  result.points = {bent(0.1F, 0.006F), bent(0.1F, 0.004F), bent(0.1F, 0.1F), bent(0.1F, 0.1F), {},
                   bent(0.1F, 0.1F)};
  positions[2].z() = 0;
  positions[3].z() = -0.1;
  EXPECT_THAT(find_convex(result, positions), ElementsAre(1, 0, 0, 0, 0, 1));
  EXPECT_THAT(find_convex(result, positions, {.min_gaussian_curvature = 0.0001}),
              ElementsAre(1, 1, 0, 0, 0, 1));
  EXPECT_THAT(find_convex(result, positions, {.zero_plane_m = -0.05}),
              ElementsAre(1, 0, 1, 0, 0, 1));
}

TEST(Convexity, Errors) {
  CurvatureResult result;
  result.points = {bent(3, 2)};
  EXPECT_EQ(error_of([&] { find_convex(result, {}); }).context().field, "positions");
  EXPECT_EQ(error_of([&] { find_convex(result, {Vector3d::Zero()}, {.min_curvature_per_m = nan}); })
                .context()
                .field,
            "min_curvature_per_m");
  for (const double distance : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_EQ(error_of([&] { mark_near_convex({}, {}, distance); }).context().field, "distance_m");
}

TEST(NearConvex, AgreesWithAllPairs) {
  for (const double size : {0.05, 0.3, 2.0}) {
    std::vector<Vector3d> positions, points;
    for (int i = 0; i < 2000; ++i)
      positions.emplace_back(uniform(-size, size), uniform(-size, size), uniform(-0.1, 0.1));
    for (int i = 0; i < 200; ++i)
      points.emplace_back(uniform(-size, 0), uniform(-size, size), uniform(-0.1, 0.1));
    const auto near = mark_near_convex(positions, points, 0.03);
    std::size_t count = 0;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const bool expected = std::any_of(points.begin(), points.end(), [&](const Vector3d& p) {
        return (p - positions[i]).norm() < 0.03;
      });
      ASSERT_EQ(near[i], expected ? 1 : 0);
      count += near[i];
    }
    EXPECT_GT(count, 0u);
    EXPECT_LT(count, positions.size());
    const libmap::ThreadLimit limit(1);
    EXPECT_EQ(near, mark_near_convex(positions, points, 0.03));
  }
}

TEST(NearConvex, CloserThanTheDistanceNotAtIt) {
  const std::vector<Vector3d> at{{0.5, 0, 0}, {-0.5, 0, 0}, {0, 0.4999, 0}, {0, 0, -0.5001}};
  EXPECT_THAT(mark_near_convex(at, {Vector3d::Zero()}, 0.5), testing::ElementsAre(0, 0, 1, 0));
  EXPECT_THAT(mark_near_convex({Vector3d::Zero()}, {Vector3d::Zero()}, 1e-9),
              testing::ElementsAre(1));
}

TEST(NearConvex, EmptyAndNotFinite) {
  EXPECT_TRUE(mark_near_convex({}, {{0, 0, 0}}, 1).empty());
  const std::vector<Vector3d> coordinates{{0, 0, 0}, {nan, 0, 0}, {1e300, 0, 0}};
  EXPECT_THAT(mark_near_convex(coordinates, {}, 1), testing::Each(0));
  EXPECT_THAT(mark_near_convex(coordinates, {{nan, 0, 0}}, 1), testing::Each(0));
  EXPECT_THAT(mark_near_convex(coordinates, {{0, 0, 0.1}, {0, nan, 0}}, 1),
              testing::ElementsAre(1, 0, 0));
}

}  // namespace convexity_test
