#include "libgtd/shape/point_grid.h"

#include <gmock/gmock.h>

#include <limits>
#include <set>

#include "tests/support/test_support.h"

namespace {

using Eigen::Vector3d;
using graspmap_test::error_of;
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
    const PointGrid::Range range = grid.range_of(grid.cells()[c]);
    EXPECT_EQ(range.first, grid.ranges()[c].first);
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

TEST(PointGrid, AnEmptyOneReachesNothing) {
  const PointGrid grid({}, 1);
  EXPECT_TRUE(grid.cells().empty());
  EXPECT_FALSE(grid.reaches({0, 0, 0}));
}

TEST(PointGrid, ReachesOneCellBeyondThePoints) {
  const PointGrid grid({{0, 0, 0}, {1, 1, 1}}, 0.5);
  EXPECT_TRUE(grid.reaches({1.49, 0, -0.49}));
  EXPECT_FALSE(grid.reaches({1.51, 0, 0}));
  EXPECT_FALSE(grid.reaches({0, std::numeric_limits<double>::quiet_NaN(), 0}));
  EXPECT_FALSE(grid.reaches({0, 0, std::numeric_limits<double>::infinity()}));
  EXPECT_EQ(grid.range_of({100, 0, 0}).last, 0u);
}

TEST(PointGrid, RefusesCellsWithoutSizeOrTooMany) {
  for (const double size : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                            std::numeric_limits<double>::infinity()})
    error_of([&] { PointGrid({{0, 0, 0}}, size); });
  error_of([&] { PointGrid({{0, 0, 0}, {1e9, 0, 0}}, 1e-6); });
  error_of([&] { PointGrid({{-1e308, 0, 0}, {1e308, 0, 0}}, 1); });
}

}  // namespace
