#include "libmap/poses/stamp_pairing.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace libmap {

namespace {

// Stamps near 1e9 s are multiples of 1.2e-7 s, so their differences are not exact decimals.
constexpr double rounding_s = 1e-6;

std::vector<std::size_t> order_by_stamp(const std::vector<double>& stamps) {
  std::vector<std::size_t> order(stamps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return stamps[i] < stamps[j]; });
  return order;
}

// Returns the nearest stamp, the first in `order` for equal distances. `order` must not be empty.
std::size_t nearest(const std::vector<double>& stamps, const std::vector<std::size_t>& order,
                    double stamp) {
  const auto after =
      std::lower_bound(order.begin(), order.end(), stamp,
                       [&](std::size_t index, double value) { return stamps[index] < value; });
  if (after == order.begin()) return *after;
  const std::size_t before = *(after - 1);
  if (after == order.end()) return before;
  return stamps[*after] - stamp < stamp - stamps[before] ? *after : before;
}

}  // namespace

std::vector<std::pair<std::size_t, std::size_t>> pair_by_stamp(const std::vector<double>& a,
                                                               const std::vector<double>& b,
                                                               double tolerance_s) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  if (b.empty()) return pairs;
  const std::vector<std::size_t> order = order_by_stamp(b);
  std::vector<std::optional<std::size_t>> owner(b.size());
  const auto distance = [&](std::size_t i, std::size_t j) { return std::abs(a[i] - b[j]); };
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::size_t j = nearest(b, order, a[i]);
    if (!(distance(i, j) <= tolerance_s + rounding_s)) continue;
    if (!owner[j] || distance(i, j) < distance(*owner[j], j)) owner[j] = i;
  }
  for (std::size_t j = 0; j < b.size(); ++j)
    if (owner[j]) pairs.emplace_back(*owner[j], j);
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace libmap
