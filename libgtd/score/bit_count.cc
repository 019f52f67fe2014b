#include "libgtd/score/bit_count.h"

namespace libgtd {

__attribute__((target_clones("popcnt", "default"))) BitCounts count_bits(
    const std::uint64_t* bits, std::size_t words_per_row, std::size_t first_row,
    std::size_t first_bit, const MaskRow* rows, std::size_t row_count) {
  BitCounts counts;
  for (std::size_t r = 0; r < row_count; ++r) {
    const MaskRow& row = rows[r];
    const std::size_t bit = first_bit + row.bit_offset;
    const std::uint64_t* word = bits + (first_row + row.row_offset) * words_per_row + bit / 64;
    // Shifting by 63 - n and then by one avoids the undefined shift by 64.
    const std::uint64_t window = (word[0] >> (bit % 64)) | ((word[1] << (63 - bit % 64)) << 1);
    counts.ssv += static_cast<std::uint32_t>(__builtin_popcountll(window & row.counted));
    counts.gsv += static_cast<std::uint32_t>(__builtin_popcountll(window & row.solid));
  }
  return counts;
}

}  // namespace libgtd
