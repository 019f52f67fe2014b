#include "libgtd/shape/point_grid.h"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "libmap/core/text.h"
#include "tests/support/test_support.h"

namespace point_grid_test {

using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::PointGrid;

TEST(PointGrid, HoldsEachFinitePointOnceInItsCell) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 1000; ++i)
    points.emplace_back(uniform(-1, 1) + 1e6, uniform(-1, 1), uniform(-1, 1));
  points[17].y() = std::numeric_limits<double>::quiet_NaN();
  const PointGrid grid(points, 0.2);
  std::set<std::size_t> seen;
  for (std::size_t c = 0; c < grid.cells().size(); ++c) {
    const PointGrid::Range range = grid.ranges()[c];
    EXPECT_LT(range.first, range.last);
    for (std::uint32_t k = range.first; k < range.last; ++k) {
      const std::size_t i = grid.order()[k];
      EXPECT_EQ(grid.cell_of(points[i]), grid.cells()[c]);
      EXPECT_TRUE(grid.reaches(points[i]));
      if (k > range.first) {
        EXPECT_LT(grid.order()[k - 1], i);
      }
      seen.insert(i);
    }
  }
  EXPECT_EQ(seen.size(), 999u);
  EXPECT_FALSE(seen.contains(17));
}

// Compared with all points, one by one.
TEST(PointGrid, FindsAllPointsOfTheCellsNearbyInTheirOrder) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 3000; ++i)
    points.emplace_back(uniform(-3, 3), uniform(-1, 1), uniform(-0.5, 2));
  points.emplace_back(40, 0, 0);
  const PointGrid grid(points, 0.3);
  std::vector<PointGrid::Range> runs;
  for (int round = 0; round < 300; ++round) {
    const PointGrid::Cell cell =
        grid.cell_of({uniform(-4, 4), uniform(-1.5, 1.5), uniform(-1, 2.5)});
    const std::int64_t reach = round % 3;
    grid.find_near(cell, reach, runs);
    std::vector<std::uint32_t> found, expected;
    for (const PointGrid::Range& run : runs) {
      EXPECT_LT(run.first, run.last);
      found.insert(found.end(), grid.order().begin() + run.first, grid.order().begin() + run.last);
    }
    for (const std::uint32_t i : grid.order()) {
      const PointGrid::Cell at = grid.cell_of(points[i]);
      if (std::abs(at[0] - cell[0]) <= reach && std::abs(at[1] - cell[1]) <= reach &&
          std::abs(at[2] - cell[2]) <= reach)
        expected.push_back(i);
    }
    ASSERT_EQ(found, expected);
  }
}

TEST(PointGrid, FindsPointsInALine) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 20; ++i) points.emplace_back(0.5 + i, 0.5, 0.5);
  const PointGrid grid(points, 1.0);
  std::vector<PointGrid::Range> runs;
  for (std::int64_t i = 0; i < 20; ++i) {
    grid.find_near({i, 0, 0}, 0, runs);
    ASSERT_EQ(runs.size(), 1u);
    EXPECT_EQ(grid.order()[runs[0].first], static_cast<std::uint32_t>(i));
    grid.find_near({i, 0, 0}, 2, runs);
    EXPECT_EQ(runs.size(), static_cast<std::size_t>(std::min<std::int64_t>(i + 2, 19) -
                                                    std::max<std::int64_t>(i - 2, 0) + 1));
  }
}

// Cells too many for a key of 64 bits are sorted by comparison.
TEST(PointGrid, SortsCellsFarApart) {
  std::vector<Vector3d> points;
  for (int i = 0; i < 200; ++i)
    points.emplace_back(uniform(-1e9, 1e9), uniform(-1e9, 1e9), uniform(-1e9, 1e9));
  points.push_back(points[7]);
  const PointGrid grid(points, 0.01);
  ASSERT_EQ(grid.cells().size(), 200u);
  EXPECT_TRUE(std::is_sorted(grid.cells().begin(), grid.cells().end()));
  std::vector<PointGrid::Range> runs;
  grid.find_near(grid.cell_of(points[7]), 0, runs);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(grid.order()[runs[0].first], 7u);
  EXPECT_EQ(grid.order()[runs[0].last - 1], 200u);
}

TEST(PointGrid, NearPointsComeInTheSameOrderWithoutFarOnes) {
  std::vector<Eigen::Vector3d> all;
  for (int n = 0; n < 3000; ++n)
    all.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-0.1, 0.1));
  std::vector<Eigen::Vector3d> part;
  for (const Eigen::Vector3d& point : all)
    if (std::abs(point.x() - 0.3) < 0.35 && std::abs(point.y() + 0.2) < 0.35) part.push_back(point);
  const auto near = [](const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& place) {
    const PointGrid grid(points, 0.1);
    std::vector<PointGrid::Range> runs;
    grid.find_near(grid.cell_of(place), 2, runs);
    std::vector<Eigen::Vector3d> found;
    for (const PointGrid::Range& run : runs)
      for (std::uint32_t k = run.first; k < run.last; ++k) found.push_back(points[grid.order()[k]]);
    return found;
  };
  for (int n = 0; n < 30; ++n) {
    const Eigen::Vector3d place(0.3 + uniform(-0.04, 0.04), -0.2 + uniform(-0.04, 0.04), 0);
    EXPECT_GT(near(all, place).size(), 50u);
    EXPECT_EQ(near(part, place), near(all, place));
  }
}

TEST(PointGrid, AnEmptyOneReachesNothing) {
  const PointGrid grid({}, 1);
  EXPECT_TRUE(grid.cells().empty());
  EXPECT_FALSE(grid.reaches({0, 0, 0}));
  std::vector<PointGrid::Range> runs(3);
  grid.find_near({0, 0, 0}, 2, runs);
  EXPECT_TRUE(runs.empty());
}

TEST(PointGrid, ReachesOneCellBeyondThePoints) {
  const PointGrid grid({{0, 0, 0}, {1, 1, 1}}, 0.5);
  EXPECT_TRUE(grid.reaches({1.49, 0, -0.49}));
  EXPECT_FALSE(grid.reaches({1.51, 0, 0}));
  EXPECT_FALSE(grid.reaches({0, std::numeric_limits<double>::quiet_NaN(), 0}));
  EXPECT_FALSE(grid.reaches({0, 0, std::numeric_limits<double>::infinity()}));
}

TEST(PointGrid, RefusesCellsWithoutSizeOrTooMany) {
  for (const double size : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                            std::numeric_limits<double>::infinity()})
    EXPECT_TRUE(is_error(error_of([&] {
                           PointGrid({{0, 0, 0}}, size);
                         }),
                         {.value = libmap::to_text(size)}));
  EXPECT_TRUE(is_error(error_of([&] {
                         PointGrid({{0, 0, 0}, {1e9, 0, 0}}, 1e-6);
                       }),
                       {.value = "1e-06", .about = "1e+09 m"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         PointGrid({{-1e308, 0, 0}, {1e308, 0, 0}}, 1);
                       }),
                       {.value = "1", .about = "1e+308 m"}));
}

}  // namespace point_grid_test
