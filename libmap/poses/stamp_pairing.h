// Pairs data by time stamps, for example color and depth images of a camera.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace libmap {

// Default tolerance between the stamps of data that belong together, s.
inline constexpr double pairing_tolerance_s = 0.02;

// Returns pairs (index in `a`, index in `b`) with stamps that differ by at most `tolerance_s`, by
// ascending index in `a`. Each stamp of `a` selects the nearest stamp of `b`. If several select the
// same stamp, only the nearest is paired (then the first in `a`). Stamps can be in any order.
std::vector<std::pair<std::size_t, std::size_t>> pair_by_stamp(const std::vector<double>& a,
                                                               const std::vector<double>& b,
                                                               double tolerance_s);

}  // namespace libmap
