#include "libgtd/score/footholds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace footholds_test {

using graspmap_test::error_of;
using graspmap_test::uniform;
using libgtd::Foothold;
using libgtd::FootholdOptions;
using libgtd::FootholdResult;
using libmap::PointCloud;
using libmap::ScalarType;

// Map of 1 cm voxels over 1 x 1 m; `score_of` and `height_of` at (x, y). Graspable from 0.8.
PointCloud map_of(
    const std::function<double(double, double)>& score_of,
    const std::function<double(double, double)>& height_of = [](double, double) { return 0.0; }) {
  PointCloud map;
  std::vector<double> scores;
  for (int i = 0; i < 100; ++i)
    for (int j = 0; j < 100; ++j) {
      const double x = 0.01 * i + 0.005;
      const double y = 0.01 * j + 0.005;
      map.positions.emplace_back(x, y, height_of(x, y));
      scores.push_back(score_of(x, y));
    }
  map.add_field("score", ScalarType::float32).values = scores;
  std::vector<double>& graspable = map.add_field("graspable", ScalarType::uint8).values;
  for (std::size_t n = 0; n < scores.size(); ++n) graspable[n] = scores[n] >= 0.8 ? 1.0 : 0.0;
  map.add_field("border", ScalarType::uint8);
  return map;
}

PointCloud random_map() {
  return map_of([](double, double) { return std::round(uniform(0, 10)) / 10.0; },
                [](double, double) { return uniform(0, 0.05); });
}

TEST(Footholds, TheMiddleOfAPlateauComesFirst) {
  const PointCloud map = map_of([](double x, double y) {
    return std::hypot(x - 0.305, y - 0.605) < 0.1 || std::hypot(x - 0.755, y - 0.255) < 0.06 ? 0.9
                                                                                             : 0.1;
  });
  const FootholdResult result = libgtd::find_footholds(map, {.separation_m = 0.2});
  ASSERT_GE(result.footholds.size(), 2U);
  EXPECT_LT(
      (map.positions[result.footholds[0].map_point] - Eigen::Vector3d(0.305, 0.605, 0)).norm(),
      0.011);
  bool second = false;
  for (const Foothold& one : result.footholds)
    second =
        second || (map.positions[one.map_point] - Eigen::Vector3d(0.755, 0.255, 0)).norm() < 0.011;
  EXPECT_TRUE(second);
}

TEST(Footholds, OfATestedMapByProbabilityAndForce) {
  PointCloud map = map_of([](double, double) { return 1.0; });
  std::vector<double> probability(map.size(), 0.3);
  std::vector<double> force(map.size(), 0.0);
  probability[1234] = 0.9;
  probability[5678] = 0.9;
  probability[9012] = 1.0;
  force[1234] = 12.0;
  force[5678] = 34.0;
  map.add_field("hold_probability", ScalarType::float32).values = probability;
  map.add_field("holding_force_n", ScalarType::float32).values = force;
  const FootholdResult result = libgtd::find_footholds(map);
  ASSERT_EQ(result.footholds.size(), 3U);
  EXPECT_EQ(result.candidates, 3U);
  EXPECT_EQ(result.footholds[0].map_point, 9012U);
  EXPECT_EQ(result.footholds[1].map_point, 5678U);
  EXPECT_EQ(result.footholds[2].map_point, 1234U);
  EXPECT_EQ(result.footholds[1].force_n, 34.0);
}

// Oracle by definition, point by point.
std::vector<std::size_t> slow_footholds(const PointCloud& map, double separation_m) {
  const std::vector<double>& scores = map.find_field("score")->values;
  const std::vector<double>& graspable = map.find_field("graspable")->values;
  const auto mean_of = [&](std::size_t n) {
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t m = 0; m < map.size(); ++m) {
      const double fraction = (map.positions[m] - map.positions[n]).norm() / (0.5 * separation_m);
      if (fraction > 1.0) continue;
      sum += (1.0 - fraction * fraction) * scores[m];
      weights += 1.0 - fraction * fraction;
    }
    return sum / weights;
  };
  std::vector<double> means(map.size());
  std::vector<std::size_t> left;
  for (std::size_t n = 0; n < map.size(); ++n)
    if (graspable[n] != 0.0) {
      means[n] = mean_of(n);
      left.push_back(n);
    }
  std::vector<std::size_t> found;
  while (!left.empty()) {
    std::size_t best = left.front();
    for (const std::size_t n : left)
      if (scores[n] > scores[best] || (scores[n] == scores[best] && means[n] > means[best] + 1e-12))
        best = n;
    found.push_back(best);
    std::erase_if(left, [&](std::size_t n) {
      return (map.positions[n] - map.positions[best]).norm() <= separation_m;
    });
  }
  return found;
}

TEST(Footholds, AreThoseOfTheDefinition) {
  const PointCloud map = random_map();
  const FootholdResult result = libgtd::find_footholds(map, {.separation_m = 0.13});
  std::vector<std::size_t> found;
  for (const Foothold& one : result.footholds) found.push_back(one.map_point);
  EXPECT_EQ(found, slow_footholds(map, 0.13));
  EXPECT_GT(found.size(), 20U);
}

// Coincident points are valid.
TEST(Footholds, OfPointsInOnePlaceToo) {
  PointCloud map = random_map();
  std::vector<std::size_t> points(map.size());
  for (std::size_t n = 0; n < points.size(); ++n) points[n] = n % 3 == 2 ? n / 300 : n;
  map = libmap::select_points(map, points);
  for (double& score : map.find_field("score")->values) score = std::round(uniform(8, 10)) / 10.0;
  map.find_field("graspable")->values.assign(map.size(), 1.0);
  const FootholdResult result = libgtd::find_footholds(map, {.separation_m = 0.13});
  std::vector<std::size_t> found;
  for (const Foothold& one : result.footholds) found.push_back(one.map_point);
  EXPECT_EQ(found, slow_footholds(map, 0.13));
}

TEST(Footholds, ScoresThatAreNotFinite) {
  PointCloud map = random_map();
  std::vector<double>& scores = map.find_field("score")->values;
  for (std::size_t n = 0; n < map.size(); n += 7)
    scores[n] = n % 2 == 0 ? NAN : std::numeric_limits<double>::infinity();
  const FootholdResult result = libgtd::find_footholds(map, {.separation_m = 0.005});
  EXPECT_GT(result.footholds.size(), 1000U);
  for (const Foothold& one : result.footholds) {
    EXPECT_TRUE(std::isfinite(one.score));
    EXPECT_TRUE(std::isfinite(one.mean_score));
  }
  // The square of the separation underflows to 0.
  map = libmap::select_points(map, {1});
  map.positions[0].setZero();
  const auto alone = libgtd::find_footholds(map, {.separation_m = 1e-200, .graspable_only = false});
  ASSERT_EQ(alone.footholds.size(), 1U);
  EXPECT_EQ(alone.footholds[0].mean_score, alone.footholds[0].score);
}

TEST(Footholds, OptionsLeaveOut) {
  PointCloud map = random_map();
  for (std::size_t n = 0; n < map.size() / 2; ++n) map.find_field("border")->values[n] = 1.0;
  const auto all = libgtd::find_footholds(map, {.graspable_only = false, .border = true});
  EXPECT_EQ(all.candidates, map.size());
  for (const Foothold& one : libgtd::find_footholds(map).footholds)
    EXPECT_GE(one.map_point, map.size() / 2);
  PointCloud earlier = map;  // format of earlier versions
  earlier.find_field("border")->name = "edge";
  EXPECT_EQ(libgtd::find_footholds(earlier).candidates, libgtd::find_footholds(map).candidates);
  EXPECT_LT(libgtd::find_footholds(map).candidates, map.size() / 2 + 1);
  for (const Foothold& one : libgtd::find_footholds(map, {.min_score = 0.95}).footholds)
    EXPECT_EQ(one.score, 1.0);
  const auto three = libgtd::find_footholds(map, {.max_count = 3});
  const auto free = libgtd::find_footholds(map);
  ASSERT_EQ(three.footholds.size(), 3U);
  for (std::size_t n = 0; n < 3; ++n)
    EXPECT_EQ(three.footholds[n].map_point, free.footholds[n].map_point);
  // Points without a position or score do not affect footholds.
  map.positions[9000].x() = NAN;
  map.find_field("score")->values[9001] = NAN;
  for (const Foothold& one : libgtd::find_footholds(map, {.separation_m = 0.001}).footholds) {
    EXPECT_NE(one.map_point, 9000U);
    EXPECT_NE(one.map_point, 9001U);
  }
}

TEST(Footholds, NormalSlopeAndApproachOfAnInclinedPlane) {
  const double slope = 25.0 * M_PI / 180.0;
  const PointCloud map = map_of([](double, double) { return 1.0; },
                                [&](double x, double) { return std::tan(slope) * x; });
  const FootholdResult result = libgtd::find_footholds(map);
  const Eigen::Vector3f normal(static_cast<float>(-std::sin(slope)), 0.0F,
                               static_cast<float>(std::cos(slope)));
  ASSERT_FALSE(result.footholds.empty());
  for (const Foothold& one : result.footholds) {
    EXPECT_LT((one.normal - normal).norm(), 1e-3F);
    EXPECT_NEAR(one.slope_deg, 25.0, 0.1);
    EXPECT_NEAR(one.k1, 0.0F, 1e-2F);
    EXPECT_EQ(one.approach, Eigen::Vector3d(0, 0, -1));
    EXPECT_FALSE(std::signbit(one.approach.x())) << "it would be written as -0";
  }
  // All vectors rotate with the frame.
  const libmap::Pose turn(Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, 2, -1).normalized()));
  const FootholdResult turned = libgtd::find_footholds(
      libmap::transform_cloud(map, turn), {}, {.up = 3.0 * (turn * Eigen::Vector3d::UnitZ())});
  ASSERT_FALSE(turned.footholds.empty());
  for (const Foothold& one : turned.footholds) {
    EXPECT_NEAR(one.slope_deg, 25.0, 0.1);
    EXPECT_LT((one.approach + turn * Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  }
}

TEST(Footholds, SameForAnyNumberOfThreads) {
  const PointCloud map = random_map();
  const auto cloud_with = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    return libgtd::to_cloud(libgtd::find_footholds(map), map);
  };
  const PointCloud one = cloud_with(1);
  const PointCloud two = cloud_with(2);
  EXPECT_EQ(one.positions, two.positions);
  for (const char* name : {"mean_score", "slope_deg", "k1", "k2", "approach_z"})
    for (std::size_t n = 0; n < one.size(); ++n) {
      const double a = one.find_field(name)->values[n];
      const double b = two.find_field(name)->values[n];
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << name << ' ' << n;
    }
  EXPECT_EQ(one.find_field("score")->values.size(), one.size());
}

TEST(Footholds, ErrorsNameTheField) {
  PointCloud map = random_map();
  EXPECT_EQ(error_of([&] { libgtd::find_footholds(map, {.separation_m = 0.0}); }).context().field,
            "separation_m");
  EXPECT_EQ(error_of([&] { libgtd::find_footholds(map, {}, {.up = Eigen::Vector3d::Zero()}); })
                .context()
                .field,
            "up");
  std::erase_if(map.fields, [](const auto& field) { return field.name == "border"; });
  EXPECT_EQ(error_of([&] { libgtd::find_footholds(map); }).context().field, "border");
  EXPECT_NO_THROW(libgtd::find_footholds(map, {.border = true}));
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] { libgtd::find_footholds(PointCloud{}); }),
                                      {.field = "points of the map"}));
}

}  // namespace footholds_test
