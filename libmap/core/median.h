// Computes the median of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace libmap {

// Returns the median of at least one value; for an even number, the larger of the middle values.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace libmap
