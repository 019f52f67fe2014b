#include "libgtd/shape/curvature.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "libgtd/terrain/regression_plane.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace curvature_test {

using Eigen::Vector3d;
using Eigen::Vector3f;
using graspmap_test::error_of;
using graspmap_test::uniform;
using libgtd::Curvature;
using libgtd::CurvatureMethod;
using libgtd::CurvatureOptions;
using libgtd::CurvatureResult;
using libgtd::estimate_curvature;
using libmap::PointCloud;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

CurvatureOptions within(double radius_m, CurvatureMethod method = CurvatureMethod::corrected) {
  CurvatureOptions options;
  options.radius_m = radius_m;
  options.method = method;
  return options;
}

double normal_noise() {  // Box and Muller 1958
  return std::sqrt(-2 * std::log(uniform(1e-300, 1))) *
         std::cos(2 * std::numbers::pi * uniform(0, 1));
}

// Surface z(x, y) over the square of half side `half`; the first point is above (0, 0).
template <typename Height>
PointCloud surface(std::size_t count, double half, const Height& height, double noise = 0) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = i == 0 ? 0 : uniform(-half, half);
    const double y = i == 0 ? 0 : uniform(-half, half);
    cloud.positions.emplace_back(x, y, height(x, y) + (noise > 0 ? noise * normal_noise() : 0));
  }
  return cloud;
}

// Evenly distributed points of the whole sphere with outward normals.
PointCloud sphere(std::size_t count, double radius) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = uniform(-1, 1), turn = uniform(0, 2 * std::numbers::pi);
    const double r = std::sqrt(1 - z * z);
    const Vector3d n(r * std::cos(turn), r * std::sin(turn), z);
    cloud.positions.push_back(radius * n);
    cloud.normals.push_back((0.5 * n).cast<float>());
  }
  return cloud;
}

Curvature at_first(const PointCloud& cloud, const CurvatureOptions& options) {
  return estimate_curvature(cloud, options, std::vector<std::size_t>{0}).points.at(0);
}

// Direct implementation of the fit: all pairs, and least squares by Eigen's QR.
Curvature slow_curvature(const PointCloud& cloud, std::size_t query, double radius,
                         const Vector3d& up) {
  std::vector<Vector3d> near;
  for (const Vector3d& p : cloud.positions)
    if ((p - cloud.positions[query]).norm() <= radius) near.push_back(p - cloud.positions[query]);
  Eigen::MatrixXd d(near.size(), 3);
  for (std::size_t i = 0; i < near.size(); ++i) d.row(static_cast<Eigen::Index>(i)) = near[i];
  const Eigen::MatrixXd centered = d.rowwise() - d.colwise().mean();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(centered, Eigen::ComputeThinV);
  const Eigen::MatrixXd l = d * svd.matrixV();
  Eigen::MatrixXd columns(l.rows(), 6);
  const Eigen::ArrayXd u = l.col(0).array(), v = l.col(1).array();
  columns << Eigen::ArrayXd::Ones(l.rows()), u, v, u * u, u * v, v * v;
  const Eigen::VectorXd q = columns.colPivHouseholderQr().solve(l.col(2));
  const double stretch = std::sqrt(1 + q[1] * q[1] + q[2] * q[2]);
  Eigen::Matrix2d first, second;
  first << 1 + q[1] * q[1], q[1] * q[2], q[1] * q[2], 1 + q[2] * q[2];
  second << 2 * q[3], q[4], q[4], 2 * q[5];
  const Eigen::Vector2d bend =
      Eigen::Matrix2d(first.inverse() * second / stretch).eigenvalues().real();
  const Vector3d n = (svd.matrixV() * Vector3d(-q[1], -q[2], 1)).normalized();
  const double side = n.dot(up) > 0 ? 1 : -1;
  Curvature result;
  result.k1 = static_cast<float>((-side * bend).maxCoeff());
  result.k2 = static_cast<float>((-side * bend).minCoeff());
  result.normal = (side * n).cast<float>();
  return result;
}

TEST(Curvature, OfABallFromOutsideIsOneOverItsRadiusOnBothHalves) {
  const PointCloud ball = sphere(20000, 0.5);
  const CurvatureResult result = estimate_curvature(ball, within(0.1));
  EXPECT_EQ(result.valid_count, ball.size());
  for (std::size_t i = 0; i < ball.size(); ++i) {
    ASSERT_NEAR(result.points[i].k1, 2, 0.1);
    ASSERT_NEAR(result.points[i].k2, 2, 0.1);
    ASSERT_GT(result.points[i].normal.dot(ball.positions[i].normalized().cast<float>()), 0.998F);
  }
}

TEST(Curvature, OfABallFromInsideIsNegative) {
  PointCloud bowl = sphere(20000, 0.5);
  for (Vector3f& n : bowl.normals) n = -n;
  for (const Curvature& c : estimate_curvature(bowl, within(0.1)).points) {
    ASSERT_NEAR(c.k1, -2, 0.1);
    ASSERT_NEAR(c.k2, -2, 0.1);
  }
}

TEST(Curvature, WithoutNormalsUpIsOutside) {
  PointCloud dome, bowl;
  for (const Vector3d& p : sphere(40000, 0.5).positions) {
    if (p.z() > 0.1) dome.positions.push_back(p);
    if (p.z() < -0.1) bowl.positions.push_back(p);
  }
  for (const Curvature& c : estimate_curvature(dome, within(0.08)).points) ASSERT_GT(c.k2, 1.5F);
  for (const Curvature& c : estimate_curvature(bowl, within(0.08)).points) ASSERT_LT(c.k1, -1.5F);
  bowl.normals.assign(bowl.size(), Vector3f::Zero());
  for (const Curvature& c : estimate_curvature(bowl, within(0.08)).points) ASSERT_LT(c.k1, -1.5F);
  CurvatureOptions down = within(0.08);
  down.up = Vector3d(0, 0, -3);
  for (const Curvature& c : estimate_curvature(bowl, down).points) ASSERT_GT(c.k2, 1.5F);
}

TEST(Curvature, OfQuadricsIsExact) {
  struct Case {
    double xx, xy, yy, k1, k2;
  };
  for (const Case& s : {Case{-1.5, 0, -0.5, 3, 1}, Case{1.5, 0, 0.5, -1, -3}, Case{-1, 0, 1, 2, -2},
                        Case{0, 2, 0, 2, -2}, Case{-2, 0, 0, 4, 0}, Case{0, 0, 0, 0, 0}}) {
    const PointCloud cloud = surface(
        2000, 0.1, [&](double x, double y) { return s.xx * x * x + s.xy * x * y + s.yy * y * y; });
    const Curvature c = at_first(cloud, within(0.05));
    ASSERT_TRUE(c.valid);
    // The tangent frame of scattered points differs slightly from the axes of the quadric.
    EXPECT_NEAR(c.k1, s.k1, 0.02 * (std::abs(s.k1) + std::abs(s.k2)) + 1e-6);
    EXPECT_NEAR(c.k2, s.k2, 0.02 * (std::abs(s.k1) + std::abs(s.k2)) + 1e-6);
    EXPECT_GT(c.normal.z(), 0.999F);
  }
}

TEST(Curvature, OfACylinderIsOneOverItsRadiusAndZero) {
  PointCloud cylinder;
  for (int i = 0; i < 30000; ++i) {
    const double turn = uniform(0, 2 * std::numbers::pi);
    const Vector3d n(std::cos(turn), 0, std::sin(turn));
    cylinder.positions.push_back(0.3 * n + Vector3d(0, uniform(-0.5, 0.5), 0));
    cylinder.normals.push_back(n.cast<float>());
  }
  const CurvatureResult result = estimate_curvature(cylinder, within(0.06));
  for (std::size_t i = 0; i < cylinder.size(); ++i) {
    if (std::abs(cylinder.positions[i].y()) > 0.4) continue;
    ASSERT_NEAR(result.points[i].k1, 1 / 0.3, 0.2);
    ASSERT_NEAR(result.points[i].k2, 0, 0.2);
  }
}

TEST(Curvature, FirstDerivativesCountWherePlaneAndTangentDiffer) {
  // At the rim of a half ball the neighbors are on one side, so that their plane is tilted against
  // the tangent plane.
  PointCloud half;
  half.positions.emplace_back(0, 0, 0.5);
  for (const Vector3d& p : sphere(60000, 0.5).positions)
    if (p.x() > 0 && p.z() > 0) half.positions.push_back(p);
  const Curvature c = at_first(half, within(0.2));
  EXPECT_NEAR(c.k1, 2, 0.15);
  EXPECT_NEAR(c.k2, 2, 0.15);
  EXPECT_GT(c.normal.z(), 0.998F);
}

TEST(Curvature, AgreesWithTheSlowOracle) {
  const PointCloud cloud = surface(
      1500, 0.5,
      [](double x, double y) { return 0.1 * std::sin(9 * x) * std::cos(7 * y) + 0.2 * x; }, 0.001);
  const CurvatureResult result = estimate_curvature(cloud, within(0.09));
  for (std::size_t i = 0; i < 200; ++i) {
    const Curvature expected = slow_curvature(cloud, i, 0.09, Vector3d::UnitZ());
    ASSERT_TRUE(result.points[i].valid);
    ASSERT_NEAR(result.points[i].k1, expected.k1, 1e-4);
    ASSERT_NEAR(result.points[i].k2, expected.k2, 1e-4);
    ASSERT_LT((result.points[i].normal - expected.normal).norm(), 1e-5F);
  }
}

TEST(Curvature, TurningAndMovingTheCloudChangesNothing) {
  const PointCloud cloud =
      surface(3000, 0.4, [](double x, double y) { return 0.1 * std::sin(8 * x + 3 * y); });
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(2.1, Vector3d(1, -2, 0.7).normalized()));
  const PointCloud turned = libmap::transform_cloud(cloud, libmap::make_pose({3, -8, 100}, turn));
  CurvatureOptions options = within(0.09);
  const CurvatureResult a = estimate_curvature(cloud, options);
  options.up = turn * Vector3d::UnitZ();
  const CurvatureResult b = estimate_curvature(turned, options);
  ASSERT_EQ(a.valid_count, cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_NEAR(a.points[i].k1, b.points[i].k1, 1e-4);
    ASSERT_NEAR(a.points[i].k2, b.points[i].k2, 1e-4);
    ASSERT_LT((turn.cast<float>() * a.points[i].normal - b.points[i].normal).norm(), 1e-5F);
  }
}

TEST(Curvature, DoesNotDependOnTheDensity) {
  const auto dome = [](double x, double y) { return std::sqrt(0.25 - x * x - y * y); };
  for (const std::size_t count : {300u, 3000u, 30000u}) {
    const Curvature c = at_first(surface(count, 0.15, dome), within(0.09));
    EXPECT_NEAR(c.k1, 2, 0.1) << count;
    EXPECT_NEAR(c.k2, 2, 0.1) << count;
  }
}

TEST(Curvature, ScalesWithTheInverseOfTheLength) {
  PointCloud cloud = surface(2000, 0.3, [](double x, double y) { return -x * x + 0.5 * y * y; });
  const Curvature at_meters = at_first(cloud, within(0.09));
  for (Vector3d& p : cloud.positions) p *= 1000;
  const Curvature at_millimeters = at_first(cloud, within(90));
  EXPECT_NEAR(at_millimeters.k1 * 1000, at_meters.k1, 1e-4);
  EXPECT_NEAR(at_millimeters.k2 * 1000, at_meters.k2, 1e-4);
}

TEST(Curvature, NoiseAveragesOut) {
  const PointCloud plane = surface(
      8000, 0.5, [](double, double) { return 0.0; }, 0.002);
  const CurvatureResult result = estimate_curvature(plane, within(0.09));
  double square = 0;
  std::size_t inner = 0;
  for (std::size_t i = 0; i < plane.size(); ++i) {
    if (plane.positions[i].head<2>().cwiseAbs().maxCoeff() > 0.4) continue;
    square += std::pow(0.5 * (result.points[i].k1 + result.points[i].k2), 2);
    ++inner;
  }
  EXPECT_LT(std::sqrt(square / static_cast<double>(inner)), 0.25);
}

TEST(Curvature, DuplicatesOfAllPointsChangeNothing) {
  PointCloud cloud = surface(1000, 0.3, [](double x, double y) { return -x * x + x * y; });
  const Curvature once = at_first(cloud, within(0.09));
  const std::vector<Vector3d> copy = cloud.positions;
  for (int i = 0; i < 3; ++i)
    cloud.positions.insert(cloud.positions.end(), copy.begin(), copy.end());
  const Curvature often = at_first(cloud, within(0.09));
  EXPECT_NEAR(once.k1, often.k1, 1e-5);
  EXPECT_NEAR(once.k2, often.k2, 1e-5);
}

// Each query alone is unaware of coincident points.
TEST(Curvature, OfManyPointsInOnePlaceEachAsByItself) {
  PointCloud coordinates = surface(200, 0.2, [](double x, double y) { return x * x - 2 * x * y; });
  PointCloud cloud;
  for (std::size_t n = 0; n < 800; ++n) {
    cloud.positions.push_back(coordinates.positions[n < 400 ? n / 2 : n % 200]);
    const float side = n % 3 == 0 ? -1.0F : 1.0F;
    cloud.normals.emplace_back(0.0F, n % 7 == 0 ? side : 0.0F, n % 7 == 0 ? 0.0F : side);
  }
  cloud.positions[5] = Vector3d(0.0, -0.0, 0.0);
  cloud.positions[6] = Vector3d(0.0, 0.0, 0.0);
  const CurvatureResult together = estimate_curvature(cloud, within(0.09));
  EXPECT_GT(together.valid_count, 500U);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Curvature alone = estimate_curvature(cloud, within(0.09), std::vector{n}).points.at(0);
    ASSERT_EQ(together.points[n].valid, alone.valid) << n;
    if (!alone.valid) continue;
    ASSERT_EQ(together.points[n].k1, alone.k1) << n;
    ASSERT_EQ(together.points[n].k2, alone.k2) << n;
    ASSERT_EQ(together.points[n].normal, alone.normal) << n;
  }
}

void expect_no_value(const PointCloud& cloud, const CurvatureOptions& options) {
  const CurvatureResult result = estimate_curvature(cloud, options);
  EXPECT_EQ(result.valid_count, 0u);
  for (const Curvature& c : result.points) {
    EXPECT_FALSE(c.valid);
    EXPECT_TRUE(std::isnan(c.k1) && std::isnan(c.k2) && c.normal.array().isNaN().all());
  }
}

TEST(Curvature, NeverAMadeUpValue) {
  PointCloud cloud;
  expect_no_value(cloud, within(1));
  cloud.positions = {{1, 2, 3}};
  expect_no_value(cloud, within(1));
  cloud.positions.assign(100, Vector3d(1, 2, 3));
  expect_no_value(cloud, within(1));
  cloud.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};  // five
  expect_no_value(cloud, within(10));
  cloud.positions.insert(cloud.positions.end(), 20, Vector3d(0, 0, 0));  // still five positions
  expect_no_value(cloud, within(10));
  cloud.positions.clear();
  for (int i = 0; i < 100; ++i)
    cloud.positions.emplace_back(0.01 * i, 0.02 * i, 0.01 * i);  // a line
  expect_no_value(cloud, within(1));
  cloud.positions.clear();
  for (int i = -20; i <= 20; ++i) {  // two lines
    cloud.positions.emplace_back(0.01 * i, 0, 0);
    cloud.positions.emplace_back(0, 0.01 * i, 0);
  }
  expect_no_value(cloud, within(1));
  cloud.positions.clear();
  for (int i = 0; i < 300; ++i)  // a lump
    cloud.positions.push_back(Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)));
  expect_no_value(cloud, within(10));
}

TEST(Curvature, AWallAlongUpHasNoOutsideUnlessItsNormalsSaySo) {
  PointCloud wall;
  for (int i = 0; i < 500; ++i) wall.positions.emplace_back(2, uniform(-1, 1), uniform(-1, 1));
  expect_no_value(wall, within(0.5));
  wall.normals.assign(500, Vector3f(-1, 0, 0));
  const CurvatureResult result = estimate_curvature(wall, within(0.5));
  EXPECT_EQ(result.valid_count, 500u);
  EXPECT_LT(result.points[0].normal.x(), -0.999F);
}

TEST(Curvature, PointsThatAreNotFiniteAreNobodysNeighbors) {
  PointCloud cloud = surface(500, 0.2, [](double x, double y) { return x * x - y * y; });
  const CurvatureResult clean = estimate_curvature(cloud, within(0.1));
  cloud.positions.emplace_back(nan, 0, 0);
  cloud.positions.emplace_back(0, 0, std::numeric_limits<double>::infinity());
  for (const auto method : {CurvatureMethod::corrected, CurvatureMethod::thesis}) {
    const CurvatureResult result = estimate_curvature(cloud, within(0.1, method));
    EXPECT_EQ(result.valid_count, 500u);
    EXPECT_FALSE(result.points[500].valid);
    EXPECT_FALSE(result.points[501].valid);
    if (method == CurvatureMethod::corrected) {
      EXPECT_EQ(result.points[3].k1, clean.points[3].k1);
    }
  }
}

std::uint32_t bits_of(float number) { return std::bit_cast<std::uint32_t>(number); }

TEST(Curvature, SameBitsWithAnyThreadsAndAnyQueries) {
  const PointCloud cloud = surface(4000, 0.6, [](double x, double y) {
    return 0.1 * std::sin(8 * x) + 0.05 * std::cos(11 * y);
  });
  const auto same = [](const Curvature& a, const Curvature& b) {
    return bits_of(a.k1) == bits_of(b.k1) && bits_of(a.k2) == bits_of(b.k2) && a.normal == b.normal;
  };
  for (const auto method : {CurvatureMethod::corrected, CurvatureMethod::thesis}) {
    const CurvatureOptions options = within(0.09, method);
    const CurvatureResult all = estimate_curvature(cloud, options);
    const libmap::ThreadLimit limit(1);
    const CurvatureResult serial = estimate_curvature(cloud, options);
    for (std::size_t i = 0; i < cloud.size(); ++i)
      ASSERT_TRUE(same(all.points[i], serial.points[i])) << i;
    const std::vector<std::size_t> queries{3999, 7, 7, 1234, 0};
    const CurvatureResult some = estimate_curvature(cloud, options, queries);
    ASSERT_EQ(some.points.size(), queries.size());
    for (std::size_t q = 0; q < queries.size(); ++q)
      EXPECT_TRUE(same(some.points[q], all.points[queries[q]])) << q;
    EXPECT_TRUE(estimate_curvature(cloud, options, std::vector<std::size_t>{}).points.empty());
  }
}

// Property required for tiles of a terrain larger than memory.
TEST(Curvature, SameBitsFromThePointsNearbyAlone) {
  PointCloud cloud;
  for (int n = 0; n < 6000; ++n) {
    const double x = uniform(-1, 1), y = uniform(-1, 1);
    cloud.positions.emplace_back(x, y, 0.1 * std::sin(5 * x) * std::cos(4 * y) + uniform(0, 0.01));
  }
  const CurvatureResult whole = estimate_curvature(cloud, within(0.1));
  const Vector3d low(-0.31, 0.17, -9), high(0.22, 0.53, 9);
  const auto inside = [&](const Vector3d& p, double margin) {
    return (p.array() >= low.array() - margin).all() && (p.array() <= high.array() + margin).all();
  };
  std::vector<std::size_t> nearby;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (inside(cloud.positions[n], 0.11)) nearby.push_back(n);
  const CurvatureResult part =
      estimate_curvature(libmap::select_points(cloud, nearby), within(0.1));
  std::size_t compared = 0;
  for (std::size_t n = 0; n < nearby.size(); ++n) {
    if (!inside(cloud.positions[nearby[n]], 0)) continue;
    const Curvature& one = whole.points[nearby[n]];
    EXPECT_EQ(bits_of(one.k1), bits_of(part.points[n].k1));
    EXPECT_EQ(bits_of(one.k2), bits_of(part.points[n].k2));
    ++compared;
  }
  EXPECT_GT(compared, 200u);
}

TEST(Curvature, ThesisCannotTellABallFromABowl) {
  const auto ball = [](double x, double y) { return 5 + std::sqrt(0.25 - x * x - y * y); };
  const auto bowl = [](double x, double y) { return 5 - std::sqrt(0.25 - x * x - y * y); };
  const Curvature a = at_first(surface(4000, 0.2, ball), within(0.09, CurvatureMethod::thesis));
  const Curvature b = at_first(surface(4000, 0.2, bowl), within(0.09, CurvatureMethod::thesis));
  for (const Curvature& c : {a, b}) {
    EXPECT_GT(c.k2, 0.001F);
    EXPECT_GE(c.k1, c.k2);
    EXPECT_LT(c.normal.z(), 0);  // toward the origin, below
  }
  EXPECT_NEAR(a.k1, b.k1, 0.2F * a.k1);
}

TEST(Curvature, RealTerrainHasNearlyEverywhereAValue) {
  GRASPMAP_REQUIRE_DATA();
  const auto path = graspmap_test::data_folder() / "clouds" / "artificial_rocks.pcd";
  const CurvatureResult result = estimate_curvature(libmap::read_cloud(path).cloud);
  EXPECT_GT(result.valid_count, 72930u * 99 / 100);
  EXPECT_TRUE(std::all_of(result.points.begin(), result.points.end(), [](const Curvature& c) {
    return !c.valid || (c.k1 >= c.k2 && std::isfinite(c.k1) && std::isfinite(c.k2) &&
                        std::abs(c.normal.norm() - 1) < 1e-5F);
  }));
}

TEST(CurvatureErrors, OptionsOutOfRange) {
  const PointCloud cloud = surface(10, 1, [](double, double) { return 0.0; });
  for (const double radius : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_EQ(error_of([&] { estimate_curvature(cloud, within(radius)); }).context().field,
              "radius_m");
  CurvatureOptions options;
  options.up = Vector3d::Zero();
  EXPECT_EQ(error_of([&] { estimate_curvature(cloud, options); }).context().field, "up");
  EXPECT_EQ(error_of([&] { estimate_curvature(cloud, {}, std::vector<std::size_t>{10}); })
                .context()
                .field,
            "query");
}

}  // namespace curvature_test
