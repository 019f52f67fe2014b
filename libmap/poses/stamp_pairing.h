// Things recorded at about the same time, such as color and depth images of one camera.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace libmap {

// Between the clocks of one camera's images, s.
inline constexpr double pairing_tolerance_s = 0.02;

// Pairs (index in `a`, index in `b`) whose stamps differ by `tolerance_s` at most, by ascending
// index in `a`. Each of `a` looks for the nearest of `b`; of several that find the same one the
// nearest has it, the earlier one in `a` where they are equally near. Any order of stamps.
std::vector<std::pair<std::size_t, std::size_t>> pair_by_stamp(const std::vector<double>& a,
                                                               const std::vector<double>& b,
                                                               double tolerance_s);

}  // namespace libmap
