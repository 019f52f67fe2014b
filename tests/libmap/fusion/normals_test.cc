#include "libmap/fusion/normals.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "libmap/core/parallel.h"
#include "libmap/fusion/surface_points.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace normals_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;

// Nearly even on a sphere (Fibonacci lattice).
PointCloud ball(int count, double radius, const Eigen::Vector3d& center = {0, 0, 0}) {
  PointCloud cloud;
  for (int n = 0; n < count; ++n) {
    const double z = 1 - (2 * n + 1.0) / count;
    const double angle = n * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    cloud.positions.push_back(
        center + radius * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z));
  }
  return cloud;
}

PointCloud ground(int side, double slope) {
  PointCloud cloud;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      cloud.positions.emplace_back(0.01 * i, 0.01 * j, slope * 0.01 * i);
  return cloud;
}

TEST(Normals, OfATiltedPlaneAreExactAndUp) {
  const NormalEstimationResult result = estimate_normals(ground(20, 0.5));
  const Eigen::Vector3d truth = Eigen::Vector3d(-0.5, 0, 1).normalized();
  for (const Eigen::Vector3f& normal : result.normals)
    EXPECT_LT((normal.cast<double>() - truth).norm(), 1e-6);
  EXPECT_EQ(result.orientation, NormalOrientation::spanning_tree);
  EXPECT_EQ(result.parts, 1U);
  EXPECT_EQ(result.undefined, 0U);
}

// The axes of the given normals do not change; their orientations are those of estimated normals.
TEST(Normals, GivenNormalsAreOriented) {
  PointCloud cloud = ground(20, 0.5);
  const Eigen::Vector3f truth = Eigen::Vector3f(-0.5F, 0, 1).normalized();
  for (std::size_t n = 0; n < cloud.size(); ++n)
    cloud.normals.push_back(truth * (uniform(0, 1) < 0.5 ? -2.0F : 2.0F));
  cloud.normals[7].setConstant(std::numeric_limits<float>::quiet_NaN());
  const NormalEstimationResult result = orient_normals(cloud);
  ASSERT_EQ(result.normals.size(), cloud.size());
  EXPECT_EQ(result.undefined, 1U);
  EXPECT_TRUE(result.normals[7].isZero(0.0F));
  for (std::size_t n = 8; n < cloud.size(); ++n)
    EXPECT_LT((result.normals[n] - truth).norm(), 1e-6F);
  cloud.viewpoint.translation() = Eigen::Vector3d(0, 0, -5);
  EXPECT_LT((orient_normals(cloud).normals[0] + truth).norm(), 1e-6F);
}

TEST(Normals, OfABallLookOutwards) {
  const Eigen::Vector3d center(5, -3, 2);
  const PointCloud cloud = ball(4000, 0.3, center);
  const NormalEstimationResult result = estimate_normals(cloud);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d out = (cloud.positions[n] - center).normalized();
    EXPECT_GT(result.normals[n].cast<double>().dot(out), 0.99);
  }
}

TEST(Normals, EachPartHasItsOwnSides) {
  PointCloud cloud = ball(2000, 0.2);
  const PointCloud other = ground(30, 0.0);
  for (const Eigen::Vector3d& position : other.positions)
    cloud.positions.push_back(position + Eigen::Vector3d(3, 0, -1));
  const NormalEstimationResult result = estimate_normals(cloud);
  EXPECT_EQ(result.parts, 2U);
  for (std::size_t n = 0; n < 2000; ++n)
    EXPECT_GT(result.normals[n].cast<double>().dot(cloud.positions[n]), 0.19);
  for (std::size_t n = 2000; n < cloud.size(); ++n) EXPECT_GT(result.normals[n].z(), 0.99F);
}

TEST(Normals, LookToTheViewpoint) {
  PointCloud cloud = ground(20, 0.0);
  cloud.viewpoint.translation() = Eigen::Vector3d(0.1, 0.1, -2);
  const NormalEstimationResult result = estimate_normals(cloud);
  EXPECT_EQ(result.orientation, NormalOrientation::viewpoint);
  for (const Eigen::Vector3f& normal : result.normals) EXPECT_LT(normal.z(), -0.99F);
}

TEST(Normals, LookToWhereEachPointWasSeenFrom) {
  PointCloud cloud = ground(20, 0.0);
  cloud.viewpoint.translation() = Eigen::Vector3d(0.1, 0.1, -2);
  for (const char* name : {"vp_x", "vp_y", "vp_z"}) cloud.add_field(name, ScalarType::float32);
  // The first half from above, the second from below.
  for (std::size_t n = 0; n < cloud.size(); ++n)
    cloud.find_field("vp_z")->values[n] = n < cloud.size() / 2 ? 2.0 : -2.0;
  const NormalEstimationResult result = estimate_normals(cloud);
  EXPECT_EQ(result.orientation, NormalOrientation::view_fields);
  for (std::size_t n = 0; n < cloud.size(); ++n)
    EXPECT_EQ(result.normals[n].z() > 0, n < cloud.size() / 2) << n;
}

TEST(Normals, SameForAnyNumberOfThreads) {
  PointCloud cloud = ball(3000, 0.3);
  for (Eigen::Vector3d& position : cloud.positions)
    position += Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)) * 0.003;
  const NormalEstimationResult first = [&] {
    const ThreadLimit limit(1);
    return estimate_normals(cloud);
  }();
  const ThreadLimit limit(4);
  EXPECT_EQ(estimate_normals(cloud).normals, first.normals);
}

TEST(Normals, FarAwayTheyAreTheSame) {
  const PointCloud near = ground(20, 0.3);
  PointCloud far = near;
  for (Eigen::Vector3d& position : far.positions) position += Eigen::Vector3d(5e5, 4e6, 100);
  const auto one = estimate_normals(near).normals;
  const auto two = estimate_normals(far).normals;
  for (std::size_t n = 0; n < one.size(); ++n) EXPECT_LT((one[n] - two[n]).norm(), 1e-4F);
}

TEST(Normals, OfALineOrAPlaceAreZero) {
  PointCloud line;
  for (int n = 0; n < 50; ++n) line.positions.emplace_back(0.01 * n, 0.02 * n, 0.0);
  EXPECT_EQ(estimate_normals(line).undefined, 50U);
  PointCloud place;
  place.positions.assign(50, {1, 2, 3});
  EXPECT_EQ(estimate_normals(place).undefined, 50U);
  EXPECT_TRUE(estimate_normals(PointCloud{}).normals.empty());
  PointCloud one;
  one.positions.assign(1, {1, 2, 3});
  EXPECT_EQ(estimate_normals(one).undefined, 1U);
}

TEST(Normals, BadInputIsNamed) {
  EXPECT_TRUE(is_error(error_of([&] { estimate_normals(ground(5, 0.0), {2}); }),
                       {.field = "normal_neighbors", .value = "2", .bound = ">= 3 and <= 1000"}));
}

}  // namespace normals_test
}  // namespace libmap
