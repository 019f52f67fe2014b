// The innermost loops of voxel matching, upright and tilted, each for several instruction sets,
// with the same bits from each. Plain pointers only: sources that are compiled for more than the
// base instruction set must see no type whose inline functions other sources compile too.
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

// From the terrain's lattice, in voxels, into a pivot's own, whose cell 0, 0, 0 is the pivot's.
struct TiltedLattice {
  double origin[3];   // center of that cell
  double axes[3][3];  // one after the other
};

// A box of tilted voxels, from `low` on, and the numbers that they go by; a layer's stride of 0
// gives a column's voxels one number.
struct TiltedBox {
  int low[3];
  int size[3];
  int stride[3];
};

struct MatchingLoops {
  // find_cells works on so many points at once.
  static constexpr std::size_t lanes = 8;

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

  // Writes the number of the voxel of each point that lies in the box, in the points' order, and
  // returns how many do. `points` are coordinates one axis after the other; they are read, and as
  // many cells may be written, up to a full set of lanes beyond `count`: of those too, so that some
  // points may come twice.
  std::size_t (*find_cells)(const double* const points[3], std::size_t count,
                            const TiltedLattice& lattice, const TiltedBox& box, int* cells);
  // How many bits two sets have in common.
  std::uint32_t (*count_common)(const std::uint64_t* a, const std::uint64_t* b, std::size_t words);
};

// Of instructions that the processor has.
const MatchingLoops& matching_loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
