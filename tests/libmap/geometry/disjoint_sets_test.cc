#include "libmap/geometry/disjoint_sets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/support/test_support.h"

namespace libmap {
namespace disjoint_sets_test {

using graspmap_test::uniform;

// Compares with labels that are overwritten at each join.
TEST(DisjointSets, AgreeWithLabels) {
  constexpr int count = 200;
  DisjointSets<std::size_t> sets(count);
  std::vector<std::size_t> labels(count);
  for (std::size_t n = 0; n < count; ++n) labels[n] = n;
  for (int join = 0; join < 150; ++join) {
    const auto a = static_cast<std::size_t>(uniform(0, count - 0.001));
    const auto b = static_cast<std::size_t>(uniform(0, count - 0.001));
    const auto [low, high] = std::minmax({labels[a], labels[b]});
    std::replace(labels.begin(), labels.end(), std::size_t{high}, std::size_t{low});
    sets.join(a, b);
    for (std::size_t n = 0; n < count; ++n) ASSERT_EQ(sets.find(n), labels[n]);
  }
}

}  // namespace disjoint_sets_test
}  // namespace libmap
