#include "libmap/site/border_band.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace border_band_test {

using Eigen::Vector2d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;

struct FloorOptions {
  double half_x = 1.5;  // of the area inside the band
  double half_y = 1.5;
  double width = 0.075;  // of the band
  double yaw_deg = 0;
  Vector2d center = {0, 0};
  double gaps = 0;     // share of the band that is missing
  bool rocks = false;  // white rocks inside, one of them touching the band
  double grain = 6;    // standard deviation of the colors
  double white = 215;
  double skew = 0;  // outward slope of the right side
};

// A floor of 5 x 5 m with one point per 8 mm, slightly off the grid.
PointCloud floor_with_band(const FloorOptions& o) {
  std::mt19937_64& engine = graspmap_test::random_engine();
  std::normal_distribution<double> grain(0, o.grain);
  std::vector<bool> missing(400);
  for (std::size_t n = 0; n < missing.size(); ++n) missing[n] = uniform(0, 1) < o.gaps;
  const Eigen::Rotation2Dd turn(o.yaw_deg * std::numbers::pi / 180);
  PointCloud cloud;
  for (double x = -2.5; x <= 2.5; x += 0.008)
    for (double y = -2.5; y <= 2.5; y += 0.008) {
      const Vector2d p(x + uniform(-0.003, 0.003), y + uniform(-0.003, 0.003));
      const double half_x = p.x() > 0 ? o.half_x + o.skew * p.y() : o.half_x;
      const double off = std::max(std::abs(p.x()) - half_x, std::abs(p.y()) - o.half_y);
      const double along = std::abs(p.x()) - half_x > std::abs(p.y()) - o.half_y ? p.y() : p.x();
      const auto piece = static_cast<std::size_t>((along + 2.5) / 0.2 * 4) % missing.size();
      bool is_white = off > 0 && off < o.width && !missing[piece];
      double z = grain(engine) * 3e-4;
      if (o.rocks)
        for (const Vector2d& rock : {Vector2d(0.3, 0.4), Vector2d(-1.2, -0.3), Vector2d(0.2, -1.3)})
          if ((p - rock).norm() < 0.28) {
            is_white = true;
            z += 0.1;
          }
      const double level = (is_white ? o.white : 105) + grain(engine);
      const auto channel = [](double value) {
        return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
      };
      const Vector2d at = o.center + turn * p;
      cloud.positions.emplace_back(at.x(), at.y(), z);
      cloud.colors.push_back(
          {channel(level + (is_white ? 0 : 40)), channel(level + 10), channel(level)});
    }
  return cloud;
}

// Largest distance between the corners found and those of the area.
double corner_error(const BorderBand& band, const FloorOptions& o) {
  const Eigen::Rotation2Dd turn(o.yaw_deg * std::numbers::pi / 180);
  double farthest = 0;
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0}) {
      const double half_x = x > 0 ? o.half_x + o.skew * y * o.half_y : o.half_x;
      const Vector2d corner = o.center + turn * Vector2d(x * half_x, y * o.half_y);
      double nearest = 1e9;
      for (const Vector2d& found : band.corners)
        nearest = std::min(nearest, (found - corner).norm());
      farthest = std::max(farthest, nearest);
    }
  return farthest;
}

TEST(BorderBand, InnerEdgeOfACleanBand) {
  for (const double width : {0.05, 0.1}) {
    FloorOptions o;
    o.width = width;
    const BorderBand band = find_border_band(floor_with_band(o));
    ASSERT_EQ(band.corners.size(), 4U);
    EXPECT_LT(corner_error(band, o), 0.006) << width;
    EXPECT_GT(band.seen, 0.85);
  }
}

TEST(BorderBand, TurnedWithGapsNoiseAndWhiteRocks) {
  for (const double yaw : {0.0, 12.0, -37.0, 44.0}) {
    FloorOptions o;
    o.yaw_deg = yaw;
    o.center = {3, -8};
    o.gaps = 0.25;
    o.rocks = true;
    o.grain = 20;
    const BorderBand band = find_border_band(floor_with_band(o));
    EXPECT_LT(corner_error(band, o), 0.015) << yaw;
  }
}

TEST(BorderBand, OblongAndSkew) {
  FloorOptions o;
  o.half_x = 2.0;
  o.half_y = 1.0;
  o.yaw_deg = 25;
  o.skew = 0.03;
  const BorderBand band = find_border_band(floor_with_band(o));
  EXPECT_LT(corner_error(band, o), 0.012);
  double twice = 0;
  for (std::size_t n = 0; n < 4; ++n) {
    const Vector2d& a = band.corners[n];
    const Vector2d& b = band.corners[(n + 1) % 4];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  EXPECT_GT(twice, 0) << "counter-clockwise";
}

TEST(BorderBand, MarginMovesEverySideInwards) {
  const FloorOptions o;
  const BorderBand band = find_border_band(floor_with_band(o), 0.1);
  FloorOptions smaller = o;
  smaller.half_x = smaller.half_y = 1.4;
  EXPECT_LT(corner_error(band, smaller), 0.006);
}

// The measured floor is 0.8 % too large.
TEST(BorderScale, SidesOfAKnownSizeGiveTheFactor) {
  for (const Vector2d& size : {Vector2d(3, 3), Vector2d(4, 2)}) {
    FloorOptions o;
    o.half_x = 1.008 * size.x() / 2;
    o.half_y = 1.008 * size.y() / 2;
    o.yaw_deg = 70;
    const BorderBand band = find_border_band(floor_with_band(o), 0.1);
    const BorderScale scale = scale_by_border(band, size);
    EXPECT_NEAR(scale.factor, 1 / 1.008, 0.002);
    EXPECT_LT(scale.deviation, 0.002);
    EXPECT_EQ(scale_by_border(band, size.reverse()).factor, scale.factor);
  }
}

TEST(BorderScale, LeastSquaresOfTheSides) {
  BorderBand band;
  band.sides_m = {2.02, 1.02, 2.02, 1.0};
  for (const Vector2d& size : {Vector2d(2, 1), Vector2d(1, 2)}) {
    const BorderScale scale = scale_by_border(band, size);
    // Sides s with true sizes t: s = r t, r = sum(s t) / sum(t t), with three degrees of freedom.
    const double ratio = 10.1 / 10;
    EXPECT_NEAR(scale.factor, 1 / ratio, 1e-12);
    const double squares = 2 * 0.01 * 0.01;
    EXPECT_NEAR(scale.deviation, std::sqrt(squares / 3 / 5) / (ratio * ratio), 1e-12);
  }
}

TEST(BorderScale, AnotherBandIsRejected) {
  BorderBand band;
  band.sides_m = {3.1, 3.0, 3.1, 3.0};
  EXPECT_NEAR(scale_by_border(band, {3, 3}).factor, 3 / 3.05, 1e-3);
  band.sides_m[0] = 3.16;
  const Error error = error_of([&] { scale_by_border(band, {3, 3}); });
  EXPECT_EQ(error.context().field, "border_size");
  EXPECT_EQ(error.context().value, "3x3");
  EXPECT_EQ(error.context().bound, "within 5 % of the sides found: 3.160, 3.000, 3.100, 3.000 m");
  EXPECT_TRUE(is_error(error_of([&] {
                         scale_by_border(band, {1, 3});
                       }),
                       {.field = "border_size", .value = "1x3"}));
}

TEST(BorderBand, MarginThatLeavesNothing) {
  const Error error = error_of([] { find_border_band(floor_with_band({}), 1.4); });
  EXPECT_TRUE(is_error(error, {.field = "side", .value = "0.2006585 m", .bound = ">= 0.5 m"}));
  EXPECT_EQ(error.context().field, "side");
  EXPECT_NEAR(std::stod(error.context().value), 0.2, 0.01);
  EXPECT_EQ(error.context().bound, ">= " + to_text(BorderBandOptions{}.min_side_m) + " m");
}

TEST(BorderBand, DimLightAndAGivenLevel) {
  FloorOptions o;
  o.white = 165;
  EXPECT_LT(corner_error(find_border_band(floor_with_band(o)), o), 0.01);
  BorderBandOptions options;
  options.white_level = 250;
  EXPECT_TRUE(is_error(error_of([&] { find_border_band(floor_with_band(o), 0, options); }),
                       {.field = "white_level", .value = "250"}));
}

TEST(BorderBand, WhatHasNone) {
  const auto refusal = [](const PointCloud& cloud) {
    return error_of([&] { find_border_band(cloud); });
  };
  FloorOptions o;
  PointCloud cloud = floor_with_band(o);
  PointCloud gray = cloud;
  gray.colors.clear();
  EXPECT_TRUE(is_error(refusal(gray), {.field = "colors"}));
  PointCloud high = cloud;
  for (Eigen::Vector3d& point : high.positions) point.z() += 3;
  EXPECT_TRUE(
      is_error(refusal(high), {.field = "heights of the points", .bound = "-0.1 to 0.15 m"}));
  o.white = 110;
  EXPECT_TRUE(
      is_error(refusal(floor_with_band(o)), {.field = "99.5 % quantile of the brightness"}));
  o.white = 215;
  o.gaps = 1;
  o.rocks = true;
  EXPECT_TRUE(is_error(refusal(floor_with_band(o)), {.field = "white share of each side"}))
      << "rocks alone are no band";
  EXPECT_TRUE(is_error(error_of([&] { find_border_band({}); }), {.field = "colors"}));
  // Three sides of a band.
  PointCloud open;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (cloud.positions[n].x() < 1.4) {
      open.positions.push_back(cloud.positions[n]);
      open.colors.push_back(cloud.colors[n]);
    }
  EXPECT_TRUE(is_error(refusal(open), {.field = "white share of each side"}));
}

TEST(BorderBand, ThreadsMakeNoDifference) {
  const PointCloud cloud = floor_with_band({});
  const ThreadLimit one(1);
  const BorderBand a = find_border_band(cloud);
  const ThreadLimit more(4);
  EXPECT_EQ(find_border_band(cloud).corners, a.corners);
}

}  // namespace border_band_test
}  // namespace libmap
