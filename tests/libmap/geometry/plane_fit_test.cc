#include "libmap/geometry/plane_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/geometry/robust.h"
#include "tests/support/test_support.h"

namespace plane_fit_test {

using Eigen::Vector3d;
using graspmap_test::uniform;

constexpr std::size_t points_per_chunk = 64;
// Points far away, for which sums about the frame's origin would be inaccurate.
const Vector3d far_origin(4e5, -3e5, 200.0);
const Vector3d plane_normal = Vector3d(0.3, -0.2, 1.0).normalized();

double height(const Vector3d& point) { return plane_normal.dot(point - far_origin); }

// A tilted square of 2 m, with a block of outliers 0.5 m above it.
std::vector<Vector3d> ground_with_block() {
  std::vector<Vector3d> points;
  for (int n = 0; n < 1000; ++n) {
    const Vector3d offset(uniform(-1, 1), uniform(-1, 1), 0.0);
    const Vector3d level = offset - plane_normal.dot(offset) * plane_normal;
    points.push_back(far_origin + level + (n % 5 == 0 ? 0.5 : 0.0) * plane_normal);
  }
  return points;
}

TEST(PlaneFit, PointsWithoutWeightDoNotTiltThePlane) {
  const std::vector<Vector3d> points = ground_with_block();
  const libmap::PlaneSpread spread = libmap::weighted_spread(
      points, points.front(), points_per_chunk,
      [](const Vector3d& point) { return libmap::tukey_weight(height(point) / 0.3); });
  EXPECT_TRUE(spread.is_plane(1e-4));
  EXPECT_NEAR(std::abs(spread.axes.col(0).dot(plane_normal)), 1.0, 1e-12);
  EXPECT_NEAR(height(spread.center), 0.0, 1e-9);
  EXPECT_NEAR(spread.variances[0], 0.0, 1e-12);
  EXPECT_NEAR(spread.variances[2], 1.0 / 3.0, 0.05);
}

TEST(PlaneFit, EqualWeightsGiveTheMeanOfAllPoints) {
  const std::vector<Vector3d> points = ground_with_block();
  const libmap::PlaneSpread spread = libmap::weighted_spread(
      points, points.front(), points_per_chunk, [](const Vector3d&) { return 2.0; });
  EXPECT_NEAR(height(spread.center), 0.1, 1e-9);
  EXPECT_NEAR(spread.variances[0], 0.04, 1e-3);  // 0.2 * 0.8 * 0.5^2
}

TEST(PlaneFit, PointsOnALineOrInOnePlaceAreNoPlane) {
  std::vector<Vector3d> line;
  for (int n = 0; n < 50; ++n) line.emplace_back(0.1 * n, 0.2 * n, 0.3);
  const auto spread_of_all = [](const std::vector<Vector3d>& points) {
    return libmap::weighted_spread(points, points.front(), points_per_chunk,
                                   [](const Vector3d&) { return 1.0; });
  };
  EXPECT_FALSE(spread_of_all(line).is_plane(1e-12));
  EXPECT_FALSE(spread_of_all({Vector3d(1, 2, 3), Vector3d(1, 2, 3)}).is_plane(1e-12));
}

TEST(PlaneFit, WithoutWeightTheOriginIsTheCenter) {
  const std::vector<Vector3d> points = ground_with_block();
  const libmap::PlaneSpread spread = libmap::weighted_spread(points, far_origin, points_per_chunk,
                                                             [](const Vector3d&) { return 0.0; });
  EXPECT_EQ(spread.center, far_origin);
  EXPECT_FALSE(spread.is_plane(0.0));
}

}  // namespace plane_fit_test
