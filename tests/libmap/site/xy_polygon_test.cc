#include "libmap/site/xy_polygon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace xy_polygon_test {

using Eigen::Vector2d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using Corners = std::vector<Vector2d>;

// Star-shaped polygon about the origin with random radii: simple, rarely convex.
Corners random_star(int count) {
  Corners corners;
  for (int n = 0; n < count; ++n) {
    const double angle = 2 * std::numbers::pi * n / count;
    corners.push_back(uniform(0.3, 2) * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return corners;
}

// Independent test by the winding angle of the outline around the point.
bool winds_around(const Corners& corners, const Vector2d& point) {
  double turned = 0;
  for (std::size_t n = 0; n < corners.size(); ++n) {
    const Vector2d a = corners[n] - point;
    const Vector2d b = corners[(n + 1) % corners.size()] - point;
    turned += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  }
  return std::abs(turned) > std::numbers::pi;
}

TEST(XyPolygon, InsideAsTheWindingNumberSays) {
  for (const int count : {3, 4, 7, 40, 1500}) {
    const Corners corners = random_star(count);
    const XyPolygon outline(corners);
    for (int n = 0; n < 150; ++n) {
      const Vector2d point(uniform(-2, 2), uniform(-2, 2));
      ASSERT_EQ(outline.contains(point), winds_around(corners, point)) << count;
    }
  }
}

TEST(XyPolygon, PointsLevelWithCorners) {
  const Corners corners = {{0, 0}, {2, -2}, {4, 0}, {6, -2}, {8, 0}, {6, 0},
                           {7, 2}, {5, 4},  {4, 2}, {3, 4},  {1, 2}, {2, 1}};
  const XyPolygon outline(corners);
  int inside = 0;
  for (double x = -0.5; x <= 9; x += 0.5)
    for (double y = -3; y <= 5; y += 1) {
      const Vector2d point(x, y);
      double nearest = 1e9;
      for (std::size_t n = 0; n < corners.size(); ++n) {
        const Vector2d a = corners[n] - point;
        const Vector2d b = corners[(n + 1) % corners.size()] - point;
        const double t = std::clamp(-a.dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
        nearest = std::min(nearest, (a + t * (b - a)).norm());
      }
      const bool expected = nearest < 1e-12 || winds_around(corners, point);
      ASSERT_EQ(outline.contains(point), expected) << point.transpose();
      inside += expected ? 1 : 0;
    }
  EXPECT_GT(inside, 40);
}

TEST(XyPolygon, BorderBelongsToIt) {
  const Corners corners = {{0, 0}, {4, 0}, {4, 3}, {2, 1}, {0, 3}};
  const XyPolygon outline(corners);
  EXPECT_NEAR(outline.area_m2(), 8, 1e-12);
  for (std::size_t n = 0; n < 5; ++n)
    for (const double t : {0.0, 0.25, 1.0}) {
      const Vector2d a = corners[n];
      const Vector2d on = a + t * (corners[(n + 1) % 5] - a);
      EXPECT_TRUE(outline.contains(on));
    }
  EXPECT_FALSE(outline.contains({2, 1.000001}));
  EXPECT_TRUE(outline.contains({2, 0.999999}));
  EXPECT_FALSE(outline.contains({-1e-6, 0}));
  EXPECT_FALSE(outline.contains({4.000001, 0}));
  EXPECT_FALSE(outline.contains({5, 3})) << "level with corners";
  EXPECT_FALSE(outline.contains({-1, 0}));
}

TEST(XyPolygon, EitherWayRoundAndClosedOrNot) {
  const XyPolygon one({{0, 0}, {2, 0}, {2, 1}});
  const XyPolygon other({{0, 0}, {2, 1}, {2, 0}, {0, 0}});
  EXPECT_EQ(one.corners(), other.corners());
  EXPECT_EQ(one.area_m2(), 1);
}

TEST(XyPolygon, FarFromTheOrigin) {
  const Vector2d far(500000.25, -4200000.5);
  Corners corners = random_star(30);
  const XyPolygon near(corners);
  Corners shifted = corners;
  for (Vector2d& corner : shifted) corner += far;
  const XyPolygon outline(shifted);
  EXPECT_NEAR(outline.area_m2(), near.area_m2(), 1e-7);
  for (int n = 0; n < 500; ++n) {
    const Vector2d point(uniform(-2, 2), uniform(-2, 2));
    ASSERT_EQ(outline.contains(point + far), near.contains(point));
  }
}

TEST(XyPolygon, EdgesNearABox) {
  const XyPolygon outline(random_star(200));
  const Corners& corners = outline.corners();
  for (int n = 0; n < 300; ++n) {
    const Vector2d low(uniform(-2, 2), uniform(-2, 2));
    const Vector2d high = low + Vector2d(uniform(0, 0.3), uniform(0, 0.3));
    const std::vector<std::uint32_t> near = outline.edges_near(low, high);
    for (std::uint32_t edge = 0; edge < corners.size(); ++edge)
      for (int step = 0; step <= 50; ++step) {
        const Vector2d on =
            corners[edge] + step / 50.0 * (corners[(edge + 1) % corners.size()] - corners[edge]);
        if ((on.array() < low.array()).any() || (on.array() > high.array()).any()) continue;
        ASSERT_TRUE(std::binary_search(near.begin(), near.end(), edge));
        break;
      }
  }
  EXPECT_TRUE(outline.edges_near({5, 5}, {6, 6}).empty());
  EXPECT_TRUE(make_rectangle({0, 0}, {9, 9}).edges_near({4, 4}, {5, 5}).empty());
}

TEST(XyPolygon, WhatIsNone) {
  const auto refusal = [](const Corners& corners) {
    return error_of([&] { const XyPolygon outline(corners); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(is_error(refusal({}), {.field = "corners", .value = "0", .bound = ">= 3"}));
  EXPECT_TRUE(
      is_error(refusal({{0, 0}, {1, 0}}), {.field = "corners", .value = "2", .bound = ">= 3"}));
  EXPECT_TRUE(is_error(refusal({{0, 0}, {1, 0}, {0, 0}}), {.field = "corner 3", .value = "(0, 0)"}))
      << "there and back";
  EXPECT_TRUE(
      is_error(refusal({{0, 0}, {1, nan}, {0, 1}}), {.field = "corner 2", .value = "(1, nan)"}));
  EXPECT_TRUE(is_error(refusal({{0, 0}, {1, 0}, {1, 0}, {0, 1}}),
                       {.field = "corner 2", .value = "(1, 0)"}));
  EXPECT_TRUE(is_error(
      refusal({{0, 0}, {1, 1}, {1, 0}, {0, 1}}),
      {.field = "edge from (0, 0) to (1, 1)", .value = "meeting the edge from (1, 0) to (0, 1)"}));
  EXPECT_TRUE(is_error(
      refusal({{0, 0}, {1, 0}, {2, 0}}),
      {.field = "edge from (2, 0) to (0, 0)", .value = "meeting the edge from (0, 0) to (1, 0)"}));
  EXPECT_TRUE(is_error(
      refusal({{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}}),
      {.field = "edge from (0, 0) to (4, 0)", .value = "meeting the edge from (4, 4) to (2, 0)"}))
      << "a corner on an edge";
  EXPECT_TRUE(is_error(
      refusal({{0, 0}, {4, 0}, {4, 4}, {4, 2}}),
      {.field = "edge from (4, 0) to (4, 4)", .value = "meeting the edge from (4, 2) to (0, 0)"}))
      << "a spike";
  EXPECT_TRUE(is_error(
      refusal({{0, 0}, {4, 0}, {4, 4}, {4, -1}, {0, -1}}),
      {.field = "edge from (4, -1) to (4, 4)", .value = "meeting the edge from (4, 4) to (4, 0)"}));
}

TEST(XyPolygon, CloudsAreCutWithAllTheirFields) {
  PointCloud cloud;
  for (int x = 0; x <= 4; ++x)
    for (int y = 0; y <= 4; ++y) cloud.positions.emplace_back(x, y, x);
  cloud.normals.assign(25, {0, 0, 1});
  cloud.colors.assign(25, {1, 2, 3});
  std::vector<double>& ids = cloud.add_field("id", ScalarType::int32).values;
  for (std::size_t n = 0; n < 25; ++n) ids[n] = static_cast<double>(n);
  const PointCloud cut = clip_cloud(cloud, {make_rectangle({1, 0}, {4, 2}), -1, 3});
  ASSERT_EQ(cut.size(), 9U) << "the border included";
  EXPECT_EQ(cut.normals.size(), 9U);
  EXPECT_EQ(cut.colors.size(), 9U);
  EXPECT_EQ(cut.find_field("id")->values, (std::vector<double>{5, 6, 7, 10, 11, 12, 15, 16, 17}));
  EXPECT_EQ(clip_cloud(cloud, {}).size(), 25U);
}

}  // namespace xy_polygon_test
}  // namespace libmap
