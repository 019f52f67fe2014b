#include "libgtd/score/bit_count.h"

#include <cstring>

#include "libgtd/score/bit_count_loops.h"
#include "libgtd/score/bit_count_x86.h"

namespace libgtd {

namespace {

constexpr std::size_t words = sizeof(MaskChunk) / sizeof(std::uint64_t);

// Population counts of pairs of bits, then of nibbles (Warren, Hacker's Delight, 5-1), eight words
// side by side; counts of bytes are added up for as many chunks as they have room for.
struct ByteCounts {
  static constexpr std::size_t most_chunks = 31;  // of at most 8 in each byte
  std::uint64_t bytes[words] = {};

  void add(const std::uint16_t* window, const MaskChunk& chunk) {
    std::uint64_t bits[words], mask[words];
    std::memcpy(bits, window, sizeof(bits));
    std::memcpy(mask, chunk.bits, sizeof(mask));
    for (std::size_t w = 0; w < words; ++w) {
      std::uint64_t v = bits[w] & mask[w];
      v -= (v >> 1) & 0x5555555555555555U;
      v = (v & 0x3333333333333333U) + ((v >> 2) & 0x3333333333333333U);
      bytes[w] += (v + (v >> 4)) & 0x0f0f0f0f0f0f0f0fU;
    }
  }
  std::uint32_t sum() const {
    constexpr std::uint64_t even = 0x00ff00ff00ff00ffU;
    std::uint64_t pairs = 0;
    for (const std::uint64_t w : bytes) pairs += (w & even) + ((w >> 8) & even);
    return static_cast<std::uint32_t>((pairs * 0x0001000100010001U) >> 48);
  }
};

void count(const std::uint16_t* window, const std::uint32_t* origins, std::size_t origin_count,
           const MaskChunk* chunks, const std::uint32_t* offsets, std::size_t chunk_count,
           std::uint32_t* counts) {
  for (std::size_t n = 0; n < origin_count; ++n) {
    const std::uint16_t* const at = window + origins[n];
    std::uint32_t total = 0;
    for (std::size_t c = 0; c < chunk_count;) {
      ByteCounts part;
      for (std::size_t k = 0; k < ByteCounts::most_chunks && c < chunk_count; ++k, ++c)
        part.add(at + offsets[c], chunks[c]);
      total += part.sum();
    }
    counts[n] = total;
  }
}

void lower(std::uint16_t* planes, std::size_t plane_count, std::size_t columns, unsigned distance) {
  loops::lower(planes, plane_count, columns, distance);
}

void slide(std::uint16_t* sums, const std::uint16_t* entering, const std::uint16_t* leaving,
           std::size_t count) {
  loops::slide(sums, entering, leaving, count);
}

void add_runs(const std::uint16_t* sums, const std::uint32_t* places, std::size_t place_count,
              std::size_t length, std::uint32_t* totals) {
  loops::add_runs(sums, places, place_count, length, totals);
}

constexpr BitLoops portable = {count, lower, slide, add_runs};

}  // namespace

const BitLoops& loops_of(InstructionSet instructions) {
  return instructions == InstructionSet::portable ? portable : x86_loops(instructions);
}

}  // namespace libgtd
