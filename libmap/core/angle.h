// Conversion factor between degrees and radians.
#pragma once

#include <numbers>

namespace libmap {

inline constexpr double radians_per_degree = std::numbers::pi / 180.0;

}  // namespace libmap
