#include "libmap/site/ground_plane.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace ground_plane_test {

using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using Points = std::vector<Vector3d>;

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

double noise(double sigma) {
  std::normal_distribution<double> normal(0.0, sigma);
  return sigma > 0.0 ? normal(graspmap_test::random_engine()) : 0.0;
}

// Adds `count` noisy points on a parallelogram.
void add_patch(Points& points, int count, const Vector3d& corner, const Vector3d& a,
               const Vector3d& b, double sigma = 0.0) {
  const Vector3d normal = a.cross(b).normalized();
  for (int n = 0; n < count; ++n)
    points.push_back(corner + uniform(0, 1) * a + uniform(0, 1) * b + noise(sigma) * normal);
}

// The five visible faces of a box on the ground, evenly covered.
void add_box(Points& points, const Vector3d& corner, const Vector3d& size, double per_m2,
             double sigma) {
  const Vector3d x(size.x(), 0, 0);
  const Vector3d y(0, size.y(), 0);
  const Vector3d z(0, 0, size.z());
  const auto count = [&](const Vector3d& a, const Vector3d& b) {
    return static_cast<int>(a.cross(b).norm() * per_m2);
  };
  add_patch(points, count(x, y), corner + z, x, y, sigma);
  add_patch(points, count(x, z), corner, x, z, sigma);
  add_patch(points, count(x, z), corner + y, x, z, sigma);
  add_patch(points, count(y, z), corner, y, z, sigma);
  add_patch(points, count(y, z), corner + x, y, z, sigma);
}

// Ground of 4 x 4 m at z = 0, more than half of it covered by 4 x 4 boxes of different heights.
Points covered_site(double sigma) {
  Points points;
  constexpr double per_m2 = 1500;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      add_box(points, {i + 0.1, j + 0.1, 0}, {0.75, 0.72, 0.2 + 0.05 * (4 * i + j)}, per_m2, sigma);
  Points ground;
  add_patch(ground, 16 * static_cast<int>(per_m2), {0, 0, 0}, {4, 0, 0}, {0, 4, 0}, sigma);
  for (const Vector3d& point : ground) {
    const double x = point.x() - std::floor(point.x());
    const double y = point.y() - std::floor(point.y());
    if (x < 0.1 || x > 0.85 || y < 0.1 || y > 0.82) points.push_back(point);
  }
  return points;
}

Points moved(Points points, const Pose& pose) {
  for (Vector3d& point : points) point = pose * point;
  return points;
}

TEST(GroundPlane, TiltedPlaneIsFoundExactly) {
  for (const Vector3d& rpy : {Vector3d(0, 0, 0), Vector3d(7, -4, 30), Vector3d(0, 25, 0)}) {
    const Pose map_from_site = make_pose_from_rpy({1, 2, -3}, rpy);
    Points points;
    add_patch(points, 4000, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
    add_box(points, {0, 0, 0}, {0.5, 0.5, 1.5}, 2000, 0);
    const GroundPlane plane = find_ground_plane(moved(points, map_from_site));
    EXPECT_LT(degrees_between(plane.normal, map_from_site.linear().col(2)), 1e-7);
    EXPECT_NEAR(plane.offset_m, plane.normal.dot(map_from_site.translation()), 1e-9);
    EXPECT_NEAR(plane.normal.norm(), 1, 1e-12);
    EXPECT_NEAR(plane.tilt_deg, degrees_between(map_from_site.linear().col(2), Vector3d::UnitZ()),
                1e-6);
    const Points level = moved(moved(points, map_from_site), level_from_map(plane));
    for (int n = 0; n < 4000; ++n) ASSERT_NEAR(level[static_cast<std::size_t>(n)].z(), 0, 1e-9);
  }
}

TEST(GroundPlane, RocksOverMoreThanHalfDoNotTiltIt) {
  for (const double sigma : {0.0, 0.003}) {
    const Pose map_from_site = make_pose_from_rpy({0, 0, 5}, {6, 8, 0});
    const Points points = moved(covered_site(sigma), map_from_site);
    const GroundPlane plane = find_ground_plane(points);
    EXPECT_LT(degrees_between(plane.normal, map_from_site.linear().col(2)), 0.01) << sigma;
    EXPECT_NEAR((map_from_site.inverse() * plane.center).z(), 0, sigma / 6 + 1e-9);
    EXPECT_LT(plane.fraction, 0.25) << "walls and tops of the boxes contain the rest";
    // The feet of the boxes are within the tolerance as well.
    EXPECT_NEAR(plane.rmse_m, sigma, 0.006);
  }
}

TEST(GroundPlane, SlopedRocksDoNotLiftIt) {
  // Wedges whose faces start at the ground and rise in the same direction.
  Points points;
  add_patch(points, 6000, {0, 0, 0}, {4, 0, 0}, {0, 4, 0}, 0.002);
  for (int n = 0; n < 6; ++n)
    add_patch(points, 1200, {0.6 * n, 0.2, 0}, {0.5, 0, 0.2}, {0, 3.5, 0}, 0.002);
  const GroundPlane plane = find_ground_plane(points);
  EXPECT_LT(degrees_between(plane.normal, Vector3d::UnitZ()), 0.02);
  EXPECT_NEAR(plane.offset_m, 0, 5e-4);
}

TEST(GroundPlane, LargerPlanesThatAreNotTheGroundDoNotWin) {
  Points ground;
  add_patch(ground, 3000, {0, 0, 0}, {3, 0, 0}, {0, 3, 0}, 0.003);
  const auto is_ground = [](const Points& points) {
    const GroundPlane plane = find_ground_plane(points);
    return degrees_between(plane.normal, Vector3d::UnitZ()) < 0.1 &&
           std::abs(plane.offset_m) < 1e-3;
  };
  Points wall = ground;
  add_patch(wall, 12000, {3, 0, 0}, {0, 3, 0}, {0, 0, 3}, 0.003);
  EXPECT_TRUE(is_ground(wall));
  Points leaning_wall = ground;
  add_patch(leaning_wall, 12000, {3, 0, 0}, {0, 3, 0}, {1.9, 0, 2}, 0.003);
  EXPECT_TRUE(is_ground(leaning_wall)) << "steeper than the tilt that is allowed";
  Points table = ground;
  add_patch(table, 9000, {-3, 0, 0.7}, {3, 0, 0}, {0, 3, 0}, 0.003);
  EXPECT_TRUE(is_ground(table)) << "higher";
  Points ceiling = ground;
  add_patch(ceiling, 9000, {0, 0, 2.4}, {3, 0, 0}, {0, 3, 0}, 0.003);
  EXPECT_TRUE(is_ground(ceiling));
  Points ramp_up = ground;
  add_patch(ramp_up, 6000, {3, 0, 0}, {3, 0, 1.5}, {0, 3, 0}, 0.003);
  EXPECT_TRUE(is_ground(ramp_up)) << "steeper";
  Points ramp_down = ground;
  add_patch(ramp_down, 6000, {3, 0, 0}, {3, 0, -1.5}, {0, 3, 0}, 0.003);
  EXPECT_TRUE(is_ground(ramp_down)) << "it falls off the ground";
  Points pit = ground;
  add_patch(pit, 400, {-1, 0, -0.4}, {1, 0, 0}, {0, 1, 0}, 0.003);
  EXPECT_TRUE(is_ground(pit)) << "lower, but small";
  Points reflections = ground;
  for (int n = 0; n < 1500; ++n)
    reflections.emplace_back(uniform(0, 3), uniform(0, 3), uniform(-2, 0));
  EXPECT_TRUE(is_ground(reflections));
}

TEST(GroundPlane, LowerMeansUnderThePlaneEvenIfUpIsRough) {
  Points points;
  add_patch(points, 3000, {0, 0, 0}, {3, 0, 0}, {0, 3, 0}, 0.002);
  add_patch(points, 6000, {-12, 0, 0.7}, {3, 0, 0}, {0, 3, 0}, 0.002);
  GroundPlaneOptions options;
  options.up = {std::sin(0.35), 0, std::cos(0.35)};  // along this direction, the table is 3 m lower
  EXPECT_NEAR(find_ground_plane(points, options).offset_m, 0, 1e-3);
}

TEST(GroundPlane, LowerOfTwoTerraces) {
  Points points;
  add_patch(points, 3000, {0, 0, 0}, {3, 0, 0}, {0, 3, 0}, 0.002);
  add_patch(points, 1500, {3, 0, -0.5}, {2, 0, 0}, {0, 3, 0}, 0.002);
  EXPECT_NEAR(find_ground_plane(points).offset_m, -0.5, 1e-3);
  GroundPlaneOptions options;
  options.min_fraction_of_largest = 0.9;
  EXPECT_NEAR(find_ground_plane(points, options).offset_m, 0, 1e-3);
}

TEST(GroundPlane, TurnsWithTheMap) {
  const Points site = covered_site(0.002);
  const GroundPlane straight = find_ground_plane(site);
  const Points level = moved(site, level_from_map(straight));
  for (int turn = 0; turn < 6; ++turn) {
    const Pose map_from_site =
        make_pose_from_rpy({uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)},
                           {uniform(-180, 180), uniform(-90, 90), uniform(-180, 180)});
    GroundPlaneOptions options;
    options.up = 3.0 * map_from_site.linear().col(2);
    const GroundPlane plane = find_ground_plane(moved(site, map_from_site), options);
    const Points level_again = moved(moved(site, map_from_site), level_from_map(plane));
    for (std::size_t n = 0; n < site.size(); n += 97)
      ASSERT_NEAR(level_again[n].z(), level[n].z(), 1e-7);
  }
}

TEST(GroundPlane, OrderAndThreadsMakeNoDifference) {
  Points points = covered_site(0.003);
  const GroundPlane plane = find_ground_plane(points);
  for (const unsigned threads : {1U, 2U, 5U}) {
    const ThreadLimit limit(threads);
    const GroundPlane again = find_ground_plane(points);
    EXPECT_EQ(again.normal, plane.normal);
    EXPECT_EQ(again.offset_m, plane.offset_m);
    EXPECT_EQ(again.inliers, plane.inliers);
  }
  std::shuffle(points.begin(), points.end(), graspmap_test::random_engine());
  const GroundPlane shuffled = find_ground_plane(points);
  EXPECT_LT(degrees_between(shuffled.normal, plane.normal), 1e-6);
  EXPECT_NEAR(shuffled.offset_m, plane.offset_m, 1e-8);
  GroundPlaneOptions other_seed;
  other_seed.seed = 77;
  EXPECT_LT(degrees_between(find_ground_plane(points, other_seed).normal, plane.normal), 1e-6);
}

TEST(GroundPlane, FarFromTheOrigin) {
  const Vector3d far(500000, -4200000, 300);
  Points points = covered_site(0.002);
  const GroundPlane near = find_ground_plane(points);
  for (Vector3d& point : points) point += far;
  const GroundPlane plane = find_ground_plane(points);
  EXPECT_LT(degrees_between(plane.normal, near.normal), 1e-5);
  EXPECT_NEAR(plane.offset_m - plane.normal.dot(far), near.offset_m, 1e-5);
  // Rotated about its center, not about the origin.
  const Pose level = level_from_map(plane);
  for (const Vector3d& point : points) {
    ASSERT_LT((level * point - point).head<2>().norm(), 0.01);
    ASSERT_LT(std::abs((level * point).z()), 1.1);
  }
}

TEST(GroundPlane, LevelIsTheLeastRotation) {
  GroundPlane plane;
  plane.normal = Vector3d(0.1, -0.2, 0.9).normalized();
  plane.offset_m = 2;
  plane.center = {4, 5, 0};  // off the plane: projected onto it
  const Pose level = level_from_map(plane);
  const Eigen::AngleAxisd turn(level.linear());
  EXPECT_NEAR(turn.axis().z(), 0, 1e-12);
  EXPECT_NEAR(turn.angle(), std::acos(plane.normal.z()), 1e-12);
  const Vector3d on_plane = plane.center - (plane.normal.dot(plane.center) - 2) * plane.normal;
  EXPECT_LT((level * on_plane - Vector3d(on_plane.x(), on_plane.y(), 0)).norm(), 1e-12);
  EXPECT_NEAR((level * (on_plane + 3 * plane.normal)).z(), 3, 1e-12);
  GroundPlane flat;
  flat.offset_m = 0;
  EXPECT_TRUE(level_from_map(flat).matrix().isIdentity(0.0));
  GroundPlane upside_down;
  upside_down.normal = -Vector3d::UnitZ();
  upside_down.offset_m = 1;  // z = -1
  const Pose over = level_from_map(upside_down);
  EXPECT_NEAR(over.linear().determinant(), 1, 1e-12);
  EXPECT_NEAR((over * Vector3d(7, 8, -1)).z(), 0, 1e-12);
  EXPECT_NEAR((over * Vector3d(7, 8, -3)).z(), 2, 1e-12);
}

// Natural terrain: the error suggests a tolerance with which there is a plane.
TEST(GroundPlane, RoughTerrainIsToldItsTolerance) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 100; ++i)
    for (int j = 0; j < 100; ++j)
      points.emplace_back(0.05 * i, 0.05 * j, graspmap_test::uniform(-1.5, 1.5));
  const std::string option = "--plane-tolerance ";
  const std::string reason = error_of([&] { find_ground_plane(points); }).reason();
  const std::size_t at = reason.find(option);
  ASSERT_NE(at, std::string::npos) << reason;
  GroundPlaneOptions options;
  options.tolerance_m = std::stod(reason.substr(at + option.size()));
  EXPECT_LT(find_ground_plane(points, options).tilt_deg, 40.0);
  // A wall, for which z is not up.
  for (Vector3d& point : points) point = Vector3d(0.01 * point.z(), point.y(), point.x());
  EXPECT_TRUE(is_error(error_of([&] { find_ground_plane(points); }),
                       {.field = "share of the points on the largest plane",
                        .value = "0.0 %",
                        .bound = ">= 5.0 %",
                        .about = "--up"}));
}

TEST(GroundPlane, WhatCannotBe) {
  EXPECT_EQ(error_of([] { find_ground_plane({}); }).context().value, "0");
  EXPECT_EQ(error_of([&] { find_ground_plane({{0, 0, 0}, {1, 0, 0}}); }).context().value, "2");
  Points line;
  for (int n = 0; n < 100; ++n) line.emplace_back(0.3 * n, 0.1 * n, 1);
  EXPECT_TRUE(is_error(error_of([&] { find_ground_plane(line); }), {.field = "points"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         find_ground_plane(Points(50, {1, 2, 3}));
                       }),
                       {.field = "points"}));
  Points wall;
  add_patch(wall, 2000, {0, 0, 0}, {0, 1, 0}, {0, 0, 1}, 0.002);
  EXPECT_TRUE(is_error(error_of([&] { find_ground_plane(wall); }),
                       {.field = "share of the points on the largest plane",
                        .value = "0.0 %",
                        .bound = ">= 5.0 %"}));
  Points dust;
  for (int n = 0; n < 5000; ++n) dust.emplace_back(uniform(0, 9), uniform(0, 9), uniform(0, 9));
  EXPECT_TRUE(is_error(error_of([&] { find_ground_plane(dust); }),
                       {.field = "share of the points on the largest plane",
                        .bound = ">= 5.0 %",
                        .about = "--plane-tolerance"}));
  const Points triangle = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  EXPECT_NEAR(find_ground_plane(triangle).offset_m, 1, 1e-12) << "three are enough";
  GroundPlaneOptions options;
  options.tolerance_m = 0;
  EXPECT_EQ(error_of([&] { find_ground_plane(triangle, options); }).context().field,
            "plane_tolerance_m");
  options = {};
  options.max_tilt_deg = 90;
  EXPECT_EQ(error_of([&] { find_ground_plane(triangle, options); }).context().field,
            "max_tilt_deg");
  options = {};
  options.up = Vector3d::Zero();
  EXPECT_EQ(error_of([&] { find_ground_plane(triangle, options); }).context().field, "up");
}

TEST(GroundPlane, RealSite) {
  GRASPMAP_REQUIRE_DATA();
  const Points points =
      read_cloud(graspmap_test::data_folder() / "clouds/artificial_rocks.pcd").cloud.positions;
  const GroundPlane plane = find_ground_plane(points);
  EXPECT_LT(plane.tilt_deg, 1.5);
  EXPECT_GT(plane.fraction, 0.4);
  EXPECT_LT(plane.rmse_m, 0.01);
  // Hardly any points are below the ground.
  const auto below = std::count_if(points.begin(), points.end(), [&](const Vector3d& point) {
    return plane.normal.dot(point) < plane.offset_m - 0.05;
  });
  EXPECT_LT(static_cast<double>(below), 0.01 * static_cast<double>(points.size()));
  const Pose turn = make_pose_from_rpy({3, 1, 2}, {20, -10, 70});
  const GroundPlane turned = find_ground_plane(moved(points, turn));
  EXPECT_LT(degrees_between(turned.normal, turn.linear() * plane.normal), 0.01);
}

}  // namespace ground_plane_test
}  // namespace libmap
