// The innermost loop of voxel matching. Its source sees no library type, so that it alone may be
// compiled for several instruction sets; the one to run is chosen when the program starts.
#pragma once

#include <cstddef>
#include <cstdint>

namespace libgtd {

// One row of a mask layer: up to 64 bits of row `row` of the window from bit `bit` on.
struct MaskRow {
  std::uint32_t row_offset = 0;  // row of the window, relative to the pivot's first row
  std::uint32_t bit_offset = 0;  // bit within the row, relative to the pivot's first bit
  std::uint64_t counted = 0;     // V
  std::uint64_t solid = 0;       // V and M
};

struct BitCounts {
  std::uint32_t ssv = 0;
  std::uint32_t gsv = 0;
};

// Population counts of the window's bits under the rows of a mask. `bits` holds rows of
// `words_per_row` words, the last of each row zero, so that reading one word too far is allowed;
// the window of this pivot begins at row `first_row`, bit `first_bit`.
BitCounts count_bits(const std::uint64_t* bits, std::size_t words_per_row, std::size_t first_row,
                     std::size_t first_bit, const MaskRow* rows, std::size_t row_count);

}  // namespace libgtd
