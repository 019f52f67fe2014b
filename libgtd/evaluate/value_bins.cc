#include "libgtd/evaluate/value_bins.h"

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr double max_bins = 100'000.0;
constexpr double rounding = 1e-9;  // of a bin's width

}  // namespace

std::size_t ValueBins::bin_of(double value) const {
  const double bin = std::floor((value - first_edge) / width + rounding);
  return bin > 0.0 ? std::min(static_cast<std::size_t>(bin), count - 1) : 0;
}

ValueBins bins_over(double low, double high, double width, const char* field) {
  if (!(width > 0.0))
    throw libmap::Error("no width of a bin",
                        {.field = field, .value = libmap::to_text(width), .bound = "> 0"});
  const double first = std::floor(low / width + rounding);
  const double count = std::max(1.0, std::ceil(high / width - rounding) - first);
  if (!(count <= max_bins))
    throw libmap::Error(
        "too narrow: there would be " + libmap::to_text(count) + " bins",
        {.field = field,
         .value = libmap::to_text(width),
         .bound = ">= " + libmap::to_text(static_cast<float>((high - low) / max_bins))});
  return {first * width, width, static_cast<std::size_t>(count)};
}

}  // namespace libgtd
