// Computes the median of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace libmap {

// Returns the median of >= 1 values; for an even number of values, the larger of the middle two.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace libmap
