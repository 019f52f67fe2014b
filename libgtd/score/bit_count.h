// The innermost loops of voxel matching, each for several instruction sets. Plain pointers alone:
// sources that are compiled for more than the base instruction set must see no type whose inline
// functions other sources compile too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libgtd {

// 64 bytes of a mask: the bits of up to 32 neighboring columns, 16 layers each.
struct MaskChunk {
  static constexpr std::size_t columns = 32;
  alignas(64) std::uint16_t bits[columns];
};

struct BitLoops {
  // For each origin the sum over all chunks of popcount(window[origin + offset ...] & chunk), where
  // origins and offsets count 16-bit words. Reads 64 bytes at each of them.
  void (*count)(const std::uint16_t* window, const std::uint32_t* origins, std::size_t origin_count,
                const MaskChunk* chunks, const std::uint32_t* offsets, std::size_t chunk_count,
                std::uint32_t* counts);
  // Moves the bits of each column down by 1 <= distance < 16 layers; `planes` arrays of `columns`
  // words one after the other hold layers 0..15, 16..31, ... Zeros come in at the top.
  void (*lower)(std::uint16_t* planes, std::size_t plane_count, std::size_t columns,
                unsigned distance);
  // sums[n] += entering[n] - leaving[n].
  void (*slide)(std::uint16_t* sums, const std::uint16_t* entering, const std::uint16_t* leaving,
                std::size_t count);
  // For each place the sum of `length` values of `sums` from there on. Reads up to 64 bytes beyond.
  void (*add_runs)(const std::uint16_t* sums, const std::uint32_t* places, std::size_t place_count,
                   std::size_t length, std::uint32_t* totals);
};

// Of instructions that the processor has.
const BitLoops& loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
