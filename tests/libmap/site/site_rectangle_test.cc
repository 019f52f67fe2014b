#include "libmap/site/site_rectangle.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace site_rectangle_test {

using Eigen::Vector2d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using Places = std::vector<Vector2d>;

Vector2d turned(const Vector2d& place, double yaw_deg) {
  return Eigen::Rotation2Dd(yaw_deg * std::numbers::pi / 180) * place;
}

// A grid of points with a spacing of 2 cm over a rotated rectangle about `center`.
Places field(const Vector2d& size, double yaw_deg = 0, const Vector2d& center = {0, 0}) {
  Places places;
  const int columns = static_cast<int>(std::lround(size.x() / 0.02));
  const int rows = static_cast<int>(std::lround(size.y() / 0.02));
  for (int i = 0; i <= columns; ++i)
    for (int j = 0; j <= rows; ++j)
      places.push_back(
          center + turned(Vector2d(0.02 * i, 0.02 * j) - Vector2d(columns, rows) / 100, yaw_deg));
  return places;
}

TEST(SiteRectangle, CenteredInTheData) {
  const SiteRectangle site = find_site_rectangle(field({4, 4}), {3, 3});
  EXPECT_EQ(site.yaw_deg, 0);
  EXPECT_LT(site.center.norm(), 0.015);
  EXPECT_NEAR(site.clearance_m, 0.5, 0.011);
}

TEST(SiteRectangle, TurnsWithTheData) {
  for (const double yaw : {17.3, -31.0, 44.0, 5.0}) {
    const Vector2d center(12, -7);
    const SiteRectangle site = find_site_rectangle(field({3.4, 3.4}, yaw, center), {3, 3});
    EXPECT_NEAR(site.yaw_deg, yaw, 0.5);
    EXPECT_LT((site.center - center).norm(), 0.025);
    EXPECT_NEAR(site.clearance_m, 0.2, 0.021);
  }
}

TEST(SiteRectangle, LongSideAlongTheLongData) {
  const SiteRectangle site = find_site_rectangle(field({2.4, 4.4}, 20), {4, 2});
  EXPECT_NEAR(site.yaw_deg, -70, 0.5);
  EXPECT_NEAR(site.clearance_m, 0.2, 0.021);
  EXPECT_LT(site.center.norm(), 0.025);
}

TEST(SiteRectangle, ExactlyTheData) {
  const SiteRectangle site = find_site_rectangle(field({3, 3}), {3, 3});
  EXPECT_EQ(site.yaw_deg, 0);
  EXPECT_LT(site.center.norm(), 0.011);
}

TEST(SiteRectangle, KeepsAwayFromHoles) {
  Places places;
  for (const Vector2d& place : field({6, 4}))
    if ((place - Vector2d(-2, 0)).norm() > 0.4) places.push_back(place);
  const SiteRectangle site = find_site_rectangle(places, {3, 3});
  EXPECT_NEAR(site.clearance_m, 0.5, 0.03);
  EXPECT_GT(site.center.x() - 1.5 - site.clearance_m, -1.62);
  // A square of 0.5 m fits into the hole, one of 0.7 m does not.
  SiteRectangleOptions options;
  options.max_gap_m = 0.9;
  const SiteRectangle over = find_site_rectangle(places, {3, 3}, options);
  EXPECT_LT(std::abs(over.center.x()), 0.02) << "the hole counts as data";
}

TEST(SiteRectangle, InTheMiddleOfEquallyGoodPlaces) {
  const SiteRectangle site = find_site_rectangle(field({8, 3.2}), {3, 3});
  EXPECT_LT(site.center.norm(), 0.03);
  EXPECT_EQ(site.yaw_deg, 0);
}

TEST(SiteRectangle, SparsePointsHaveNoGaps) {
  Places places;
  for (int n = 0; n < 8000; ++n)
    places.emplace_back(graspmap_test::uniform(-2, 2), graspmap_test::uniform(-2, 2));
  const SiteRectangle site = find_site_rectangle(places, {3, 3});
  EXPECT_LT(site.center.norm(), 0.05);
  EXPECT_NEAR(site.clearance_m, 0.5, 0.1);
}

TEST(SiteRectangle, LargestIsNamedIfItDoesNotFit) {
  const Error error = error_of([] { find_site_rectangle(field({2.5, 2.5}, 30), {3, 3}); });
  EXPECT_EQ(error.context().value, "3.00 x 3.00 m");
  EXPECT_NE(error.context().bound.find("at most 2.50 x 2.50 m"), std::string::npos) << error.what();
  EXPECT_NO_THROW(find_site_rectangle(field({2.5, 2.5}, 30), {2.5, 2.5}));
  EXPECT_TRUE(is_error(error_of([&] {
                         find_site_rectangle(field({2.5, 2.5}, 30), {2.54, 2.54});
                       }),
                       {.field = "size", .value = "2.54 x 2.54 m"}));
  const Error narrow = error_of([] { find_site_rectangle(field({4, 1}), {3, 2}); });
  EXPECT_NE(narrow.context().bound.find("at most 2.02 x 1.02 m"), std::string::npos)
      << narrow.what();
  SiteRectangleOptions options;
  options.margin_m = 0.6;
  const Error margin = error_of([&] { find_site_rectangle(field({4, 4}), {3, 3}, options); });
  EXPECT_NE(margin.context().bound.find("at most 2.8"), std::string::npos) << margin.what();
  options.margin_m = 0.4;
  EXPECT_NO_THROW(find_site_rectangle(field({4, 4}), {3, 3}, options));
}

TEST(SiteRectangle, WhatCannotBe) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(is_error(error_of([&] { find_site_rectangle({}, {3, 3}); }), {.field = "points"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         find_site_rectangle({{1, 1}}, {3, 3});
                       }),
                       {.field = "size", .value = "3.00 x 3.00 m"}))
      << "one point is no site";
  EXPECT_EQ(error_of([] { find_site_rectangle(field({4, 4}), {3, 0}); }).context().field, "size");
  EXPECT_EQ(error_of([&] {
              find_site_rectangle(field({4, 4}), {nan, 3});
            })
                .context()
                .field,
            "size");
  SiteRectangleOptions options;
  options.cell_m = -1;
  EXPECT_EQ(error_of([&] {
              find_site_rectangle(field({4, 4}), {3, 3}, options);
            })
                .context()
                .field,
            "site_cell_m");
  // One distant stray point must not exhaust the memory.
  Places stray = field({4, 4});
  stray.emplace_back(1e6, 2e6);
  EXPECT_TRUE(is_error(error_of([&] {
                         find_site_rectangle(stray, {3, 3});
                       }),
                       {.field = "size of the data", .value = "1009750 x 2009600 m"}));
}

TEST(SiteRectangle, ThreadsMakeNoDifference) {
  const Places places = field({3.6, 4.1}, 12);
  const ThreadLimit one(1);
  const SiteRectangle a = find_site_rectangle(places, {3, 2});
  const ThreadLimit more(4);
  const SiteRectangle b = find_site_rectangle(places, {3, 2});
  EXPECT_EQ(a.center, b.center);
  EXPECT_EQ(a.yaw_deg, b.yaw_deg);
}

}  // namespace site_rectangle_test
}  // namespace libmap
