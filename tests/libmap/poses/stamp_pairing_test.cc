#include "libmap/poses/stamp_pairing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "tests/support/test_support.h"

namespace stamp_pairing_test {

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

TEST(StampPairing, TakesTheNearest) {
  EXPECT_EQ(libmap::pair_by_stamp({1.0, 2.0, 3.0}, {0.99, 1.015, 3.02}, 0.02),
            (Pairs{{0, 0}, {2, 2}}));
}

TEST(StampPairing, GivesOneThingToOneOtherOnly) {
  // 1.01 is the nearest for both stamps; it is paired with 1.005.
  EXPECT_EQ(libmap::pair_by_stamp({1.0, 1.005}, {1.01}, 0.02), (Pairs{{1, 0}}));
  EXPECT_EQ(libmap::pair_by_stamp({1.0, 1.0}, {1.0}, 0.02), (Pairs{{0, 0}}));
}

TEST(StampPairing, TakesTheToleranceItselfWhateverTheRounding) {
  EXPECT_EQ(libmap::pair_by_stamp({1700000000.08}, {1700000000.10}, 0.02), (Pairs{{0, 0}}));
  EXPECT_EQ(libmap::pair_by_stamp({1700000000.08}, {1700000000.1001}, 0.02), Pairs{});
  EXPECT_EQ(libmap::pair_by_stamp({5.0}, {5.0}, 0.0), (Pairs{{0, 0}}));
}

TEST(StampPairing, TakesAnyOrder) {
  EXPECT_EQ(libmap::pair_by_stamp({3.0, 1.0, 2.0}, {2.01, 3.01, 1.01}, 0.02),
            (Pairs{{0, 1}, {1, 2}, {2, 0}}));
}

TEST(StampPairing, PairsNothingWithNothing) {
  EXPECT_EQ(libmap::pair_by_stamp({}, {1.0}, 1.0), Pairs{});
  EXPECT_EQ(libmap::pair_by_stamp({1.0}, {}, 1.0), Pairs{});
  EXPECT_EQ(libmap::pair_by_stamp({std::nan("")}, {1.0}, 1.0), Pairs{});
}

TEST(StampPairing, AgreesWithComparingAllWithAll) {
  for (int round = 0; round < 50; ++round) {
    std::vector<double> a(40);
    std::vector<double> b(60);
    for (double& stamp : a) stamp = graspmap_test::uniform(0.0, 1.0);
    for (double& stamp : b) stamp = graspmap_test::uniform(0.0, 1.0);
    Pairs expected;
    for (std::size_t j = 0; j < b.size(); ++j) {
      std::size_t owner = a.size();
      for (std::size_t i = 0; i < a.size(); ++i) {
        const auto nearest = std::min_element(b.begin(), b.end(), [&](double x, double y) {
          return std::abs(x - a[i]) < std::abs(y - a[i]);
        });
        if (nearest - b.begin() != static_cast<std::ptrdiff_t>(j)) continue;
        if (std::abs(a[i] - b[j]) > 0.005) continue;
        if (owner == a.size() || std::abs(a[i] - b[j]) < std::abs(a[owner] - b[j])) owner = i;
      }
      if (owner < a.size()) expected.emplace_back(owner, j);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(libmap::pair_by_stamp(a, b, 0.005 - 1e-6), expected);
  }
}

}  // namespace stamp_pairing_test
