// Bins of one width whose edges are multiples of it.
#pragma once

#include <cstddef>

namespace libgtd {

struct ValueBins {
  double first_edge = 0.0;
  double width = 1.0;
  std::size_t count = 0;

  double low(std::size_t bin) const { return first_edge + static_cast<double>(bin) * width; }
  double high(std::size_t bin) const { return first_edge + static_cast<double>(bin + 1) * width; }
  // The bin with low <= value < high; values beyond the ends belong to the first and the last.
  std::size_t bin_of(double value) const;
};

// From the bin with `low` to the one that ends at `high` or holds it within. Throws Error naming
// `field` if there were more than 100,000.
ValueBins bins_over(double low, double high, double width, const char* field);

}  // namespace libgtd
