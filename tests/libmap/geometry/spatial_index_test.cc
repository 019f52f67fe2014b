#include "libmap/geometry/spatial_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/test_support.h"

namespace libmap {
namespace spatial_index_test {

using graspmap_test::uniform;

std::vector<Eigen::Vector3d> random_points(int count) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < count; ++n)
    points.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  return points;
}

TEST(PointTree, AgreesWithASearchOfAllPoints) {
  const std::vector<Eigen::Vector3d> points = random_points(500);
  const PointTree tree(points);
  for (const Eigen::Vector3d& at : random_points(50)) {
    std::vector<std::pair<double, std::size_t>> all;
    for (std::size_t n = 0; n < points.size(); ++n)
      all.emplace_back((points[n] - at).squaredNorm(), n);
    std::sort(all.begin(), all.end());
    // cppcheck-suppress containerOutOfBounds ; there are 500
    EXPECT_EQ(tree.nearest(at).index, all[0].second);
    const std::vector<NeighborPoint> seven = tree.nearest(at, 7);
    ASSERT_EQ(seven.size(), 7U);
    for (std::size_t n = 0; n < 7; ++n) EXPECT_NEAR(seven[n].square_m2, all[n].first, 1e-15);
    std::vector<std::size_t> near;
    for (const auto& [square, n] : all)
      if (square <= 0.09) near.push_back(n);
    std::sort(near.begin(), near.end());
    const std::vector<NeighborPoint> found = tree.within(at, 0.3);
    ASSERT_EQ(found.size(), near.size());
    for (std::size_t n = 0; n < near.size(); ++n) EXPECT_EQ(found[n].index, near[n]);
  }
}

// If several points have the same distance, also 0, the search returns one of them.
TEST(PointTree, TheNearestAmongPointsInOnePlace) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 600; ++n)
    points.emplace_back(0.25 * (n % 4), 0.25 * (n / 4 % 3), n < 300 ? 0.0 : 0.5);
  const PointTree tree(points);
  std::vector<Eigen::Vector3d> places = random_points(50);
  places.insert(places.end(), points.begin(), points.end());
  places.emplace_back(0.125, 0.125, 0.25);
  for (const Eigen::Vector3d& at : places) {
    const NeighborPoint one = tree.nearest(at);
    const std::vector<NeighborPoint> list = tree.nearest(at, 1);
    ASSERT_EQ(list.size(), 1U);
    EXPECT_EQ(one.square_m2, list[0].square_m2);
    EXPECT_EQ((points[one.index] - at).squaredNorm(), (points[list[0].index] - at).squaredNorm());
  }
}

TEST(PointTree, TheFirstOfThoseEquallyNear) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 600; ++n)
    points.emplace_back(0.25 * (n % 4), 0.25 * (n / 4 % 3), n < 300 ? 0.0 : 0.5);
  const PointTree tree(points);
  std::vector<Eigen::Vector3d> places = random_points(50);
  places.insert(places.end(), points.begin(), points.end());
  places.emplace_back(0.125, 0.125, 0.25);
  places.emplace_back(1e6, 0, 0);
  for (const Eigen::Vector3d& at : places) {
    std::pair<double, std::size_t> least{HUGE_VAL, 0};
    for (std::size_t n = 0; n < points.size(); ++n)
      least = std::min(least, {(points[n] - at).squaredNorm(), n});
    EXPECT_EQ(tree.first_of_nearest(at).index, least.second);
  }
}

TEST(PointTree, AroundAPointWithoutIt) {
  std::vector<Eigen::Vector3d> points = random_points(300);
  for (int n = 0; n < 20; ++n) points.push_back(points[7]);
  const PointTree tree(points);
  for (std::size_t n = 0; n < points.size(); ++n) {
    std::vector<double> squares;
    for (std::size_t other = 0; other < points.size(); ++other)
      if (other != n) squares.push_back((points[other] - points[n]).squaredNorm());
    std::sort(squares.begin(), squares.end());
    const std::vector<NeighborPoint> found = tree.around(n, 9, 0.3);
    for (std::size_t k = 0; k < 9; ++k) {
      ASSERT_EQ(k < found.size(), squares[k] <= 0.09);
      if (k == found.size()) break;
      EXPECT_NE(found[k].index, n);
      EXPECT_NEAR(found[k].square_m2, squares[k], 1e-15);
    }
  }
}

TEST(PointTree, AsksForMoreThanThereIs) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 0, 0}};
  EXPECT_EQ(PointTree(points).nearest({0.2, 0, 0}, 9).size(), 2U);
  EXPECT_EQ(PointTree(points).within({0, 0, 0}, 1.0).size(), 2U) << "the radius itself counts";
  const std::vector<Eigen::Vector3d> none;
  EXPECT_TRUE(PointTree(none).nearest({0, 0, 0}, 3).empty());
  EXPECT_TRUE(PointTree(none).within({0, 0, 0}, 3).empty());
}

TEST(PointTree, SpacingOfALattice) {
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < 150; ++x)
    for (int y = 0; y < 150; ++y) points.emplace_back(0.01 * x, 0.02 * y, 5.0);
  EXPECT_NEAR(median_spacing(points), 0.01, 1e-12);
  // The result does not depend on the number of points at a position.
  for (int n = 0; n < 22500; ++n)
    for (int twins = 0; twins < n % 3; ++twins)
      points.push_back(points[static_cast<std::size_t>(n)]);
  EXPECT_NEAR(median_spacing(points), 0.01, 1e-12);
  EXPECT_EQ(median_spacing(std::vector<Eigen::Vector3d>(9, {1, 2, 3})), 0.0);
  EXPECT_EQ(median_spacing({{1, 2, 3}}), 0.0);
  EXPECT_EQ(median_spacing({}), 0.0);
}

// First and last returns of a lidar, 1 to 2 mm apart, on points 5 cm apart.
TEST(MedianSpacing, NearDuplicatesAreOnePlace) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 80; ++i)
    for (int j = 0; j < 80; ++j) {
      const Eigen::Vector3d place(0.05 * i + uniform(-0.01, 0.01), 0.05 * j + uniform(-0.01, 0.01),
                                  0.3 * std::sin(0.06 * i) * std::cos(0.05 * j));
      points.push_back(place);
      points.emplace_back(place.x() + uniform(-0.001, 0.001), place.y(), place.z() - 0.001);
    }
  EXPECT_NEAR(median_spacing(points), 0.05, 0.004);
  EXPECT_NEAR(libmap::point_spacing(points).by_area_m, 0.05 / std::sqrt(2.0), 0.003);
}

TEST(MedianSpacing, RandomPointsKeepTheirNearestDistance) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 10000; ++n) points.emplace_back(uniform(0, 1), uniform(0, 1), 0);
  // For a Poisson process, the median of the nearest distance is sqrt(ln 2 / (pi n)).
  EXPECT_NEAR(median_spacing(points), std::sqrt(std::log(2) / std::numbers::pi / 10000), 2e-4);
  EXPECT_NEAR(libmap::point_spacing(points).by_area_m, 0.01, 4e-4);
}

// Every point of the box is visited, before and after the grid has grown.
TEST(GrowingGrid, VisitsAllPointsInABox) {
  const std::vector<Eigen::Vector3d> points = random_points(400);
  GrowingGrid grid({-1, -1, -1}, 0.1, 4);
  for (std::size_t count = 1; count <= points.size(); ++count) {
    grid.add(points[count - 1]);
    if (count % 50 != 1) continue;
    const Eigen::Vector3d low = Eigen::Vector3d::Constant(-0.4);
    const Eigen::Vector3d high(0.3, 0.5, 0.2);
    std::vector<bool> seen(count, false);
    grid.any_in_box(low, high, [&](const Eigen::Vector3d& point, std::uint32_t index) {
      EXPECT_EQ(point, points[index]);
      seen[index] = true;
      return false;
    });
    for (std::size_t n = 0; n < count; ++n) {
      const bool inside =
          (points[n].array() >= low.array()).all() && (points[n].array() <= high.array()).all();
      EXPECT_TRUE(seen[n] || !inside);
    }
  }
  EXPECT_EQ(grid.size(), points.size());
  EXPECT_TRUE(grid.any_nearer(points[7], 1e-6, 1e-12));
  EXPECT_FALSE(grid.any_nearer({5, 5, 5}, 0.1, 0.01));
}

}  // namespace spatial_index_test
}  // namespace libmap
