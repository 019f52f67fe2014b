// Loops that compilers turn into vector code by themselves, for bit_count*.cc alone: each calls
// them from functions of its own instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

namespace libgtd::loops {

// BitLoops::lower: all columns of the window sink by `distance` layers.
__attribute__((always_inline)) inline void lower(std::uint16_t* planes, std::size_t plane_count,
                                                 std::size_t columns, unsigned distance) {
  for (std::size_t p = 0; p + 1 < plane_count; ++p) {
    std::uint16_t* const here = planes + p * columns;
    const std::uint16_t* const above = here + columns;
    for (std::size_t n = 0; n < columns; ++n)
      here[n] = static_cast<std::uint16_t>((here[n] >> distance) | (above[n] << (16 - distance)));
  }
  std::uint16_t* const top = planes + (plane_count - 1) * columns;
  for (std::size_t n = 0; n < columns; ++n) top[n] = static_cast<std::uint16_t>(top[n] >> distance);
}

// BitLoops::slide: running sums of columns, one step on.
__attribute__((always_inline)) inline void slide(std::uint16_t* sums, const std::uint16_t* entering,
                                                 const std::uint16_t* leaving, std::size_t count) {
  for (std::size_t n = 0; n < count; ++n)
    sums[n] = static_cast<std::uint16_t>(sums[n] + entering[n] - leaving[n]);
}

__attribute__((always_inline)) inline void add_runs(const std::uint16_t* sums,
                                                    const std::uint32_t* places,
                                                    std::size_t place_count, std::size_t length,
                                                    std::uint32_t* totals) {
  for (std::size_t n = 0; n < place_count; ++n) {
    const std::uint16_t* const run = sums + places[n];
    std::uint32_t total = 0;
    for (std::size_t y = 0; y < length; ++y) total += run[y];
    totals[n] = total;
  }
}

}  // namespace libgtd::loops
