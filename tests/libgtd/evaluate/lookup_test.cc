#include "libgtd/evaluate/lookup.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace lookup_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::LookupAnswer;
using libgtd::LookupMode;
using libgtd::LookupOptions;
using libmap::PointCloud;

PointCloud random_map(std::size_t count) {
  PointCloud map;
  for (std::size_t n = 0; n < count; ++n)
    map.positions.emplace_back(uniform(0, 1), uniform(0, 1), uniform(0, 0.2));
  for (const char* name : {"score", "ssv"})
    for (double& value : map.add_field(name, libmap::ScalarType::float32).values)
      value = uniform(0, 1);
  return map;
}

std::vector<Eigen::Vector3d> random_points(std::size_t count) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t n = 0; n < count; ++n)
    points.emplace_back(uniform(-0.1, 1.1), uniform(-0.1, 1.1), uniform(-0.1, 0.3));
  return points;
}

// Oracle: tests every map point.
std::vector<std::size_t> within(const PointCloud& map, const Eigen::Vector3d& at, double radius) {
  std::vector<std::size_t> found;
  for (std::size_t n = 0; n < map.size(); ++n)
    if ((map.positions[n] - at).norm() <= radius) found.push_back(n);
  return found;
}

TEST(Lookup, NearestAgreesWithLookingAtEveryPoint) {
  const PointCloud map = random_map(800);
  const auto points = random_points(300);
  LookupOptions options;
  options.max_distance_m = 0.07;
  const auto answers = libgtd::look_up(map, points, options);
  std::size_t found = 0;
  for (std::size_t n = 0; n < points.size(); ++n) {
    std::size_t best = 0;
    for (std::size_t m = 1; m < map.size(); ++m)
      if ((map.positions[m] - points[n]).norm() < (map.positions[best] - points[n]).norm())
        best = m;
    const double distance = (map.positions[best] - points[n]).norm();
    EXPECT_EQ(answers[n].map_point, best);
    EXPECT_NEAR(answers[n].distance_m, distance, 1e-12);
    EXPECT_EQ(answers[n].found, distance <= 0.07);
    EXPECT_EQ(answers[n].values.size(), answers[n].found ? 2U : 0U);
    if (answers[n].found) {
      EXPECT_EQ(answers[n].values[0], map.fields[0].values[best]);
    }
    found += answers[n].found ? 1 : 0;
  }
  EXPECT_GT(found, 100U);
  EXPECT_LT(found, 280U);
}

TEST(Lookup, MaximumAndMeanAgreeWithLookingAtEveryPoint) {
  const PointCloud map = random_map(800);
  const auto points = random_points(200);
  LookupOptions options;
  options.radius_m = 0.09;
  options.mode = LookupMode::maximum;
  const auto best = libgtd::look_up(map, points, options);
  options.mode = LookupMode::mean;
  const auto mean = libgtd::look_up(map, points, options);
  const std::vector<double>& scores = map.fields[0].values;
  for (std::size_t n = 0; n < points.size(); ++n) {
    const auto near = within(map, points[n], 0.09);
    ASSERT_EQ(best[n].found, !near.empty());
    ASSERT_EQ(mean[n].found, !near.empty());
    EXPECT_EQ(mean[n].map_points, near.size());
    if (near.empty()) continue;
    double sum = 0.0;
    double highest = 0.0;
    for (const std::size_t m : near) {
      sum += scores[m];
      highest = std::max(highest, scores[m]);
    }
    EXPECT_EQ(best[n].values[0], highest);
    EXPECT_NEAR(mean[n].values[0], sum / static_cast<double>(near.size()), 1e-12);
  }
}

TEST(Lookup, IsTheSameForAnyNumberOfThreads) {
  const PointCloud map = random_map(500);
  const auto points = random_points(2000);
  LookupOptions options;
  options.mode = LookupMode::mean;
  options.radius_m = 0.2;
  const auto values_with = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    std::vector<std::vector<double>> values;
    for (const LookupAnswer& answer : libgtd::look_up(map, points, options))
      values.push_back(answer.values);
    return values;
  };
  const auto expected = values_with(1);
  EXPECT_EQ(values_with(2), expected);
  EXPECT_EQ(values_with(8), expected);
}

TEST(Lookup, AnswersEveryPointAlsoWithNothingThere) {
  PointCloud map;
  map.positions = {{0, 0, 0}};
  const auto answers = libgtd::look_up(
      map, {{0, 0, 0}, {5, 0, 0}, {std::numeric_limits<double>::quiet_NaN(), 0, 0}});
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_TRUE(answers[0].found);
  EXPECT_FALSE(answers[1].found);
  EXPECT_EQ(answers[1].distance_m, 5.0);
  EXPECT_FALSE(answers[2].found);
  EXPECT_TRUE(libgtd::look_up(map, {}).empty());
}

// From 10^12 m away all points of a map of 1 m have the same distance in double precision. The
// square of 10^200 m overflows.
TEST(Lookup, FromVeryFarTheFirstOfTheNearest) {
  PointCloud map;
  map.positions.assign(30'000, {1, 2, 3});
  std::vector<Eigen::Vector3d> places(20'000, {1e12, 0, 0});
  places.back() = {1, 2, 3.25};
  places.emplace_back(1e200, 0, 0);
  const auto answers = libgtd::look_up(map, places);
  EXPECT_EQ(answers.front().map_point, 0U);
  EXPECT_EQ(answers[places.size() - 2].map_point, 0U);
  EXPECT_EQ(answers[places.size() - 2].distance_m, 0.25);
  EXPECT_FALSE(answers.back().found);
  EXPECT_EQ(answers.back().distance_m, HUGE_VAL);
}

TEST(Lookup, BadInputIsAnError) {
  PointCloud map;
  EXPECT_TRUE(is_error(error_of([&] {
                         libgtd::look_up(map, {{0, 0, 0}});
                       }),
                       {.field = "points of the map"}));
  map.positions = {{0, 0, 0}};
  LookupOptions options;
  options.max_distance_m = -1.0;
  EXPECT_EQ(error_of([&] { libgtd::look_up(map, {}, options); }).context().field, "max_distance_m");
  options = {};
  options.mode = LookupMode::maximum;
  EXPECT_EQ(error_of([&] { libgtd::look_up(map, {}, options); }).context().field, "score");
}

}  // namespace lookup_test
