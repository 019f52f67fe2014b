// Inner loops of voxel matching (voxel_matching.h, tilted_matching.h), compiled for several
// instruction sets with identical results. The interface uses plain pointers only: sources compiled
// for larger instruction sets must not contain types with inline functions of other sources.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libgtd {

// 64 bytes of a mask: bits of up to 32 neighboring columns, 16 layers each.
struct MaskChunk {
  static constexpr std::size_t columns = 32;
  alignas(64) std::uint16_t bits[columns];
};

// Lattice of a tilted mask, in units of the terrain's voxels; its voxel (0, 0, 0) is the pivot.
struct TiltedLattice {
  double origin[3];   // center of voxel (0, 0, 0)
  double axes[3][3];  // axes[n] is axis n
};

// Box of tilted voxels with the lowest index `low`. The number of the voxel with index v is the sum
// of (v[a] - low[a]) * stride[a] over the axes a; with stride[2] = 0, it is the number of a column.
struct TiltedBox {
  int low[3];
  int size[3];
  int stride[3];
};

struct MatchingLoops {
  // Number of points that find_cells processes at once.
  static constexpr std::size_t lanes = 8;

  // For each origin, computes the sum over all chunks of popcount(window[origin + offset ...] &
  // chunk). Origins and offsets are in 16-bit words. Reads 64 bytes at each offset.
  void (*count)(const std::uint16_t* window, const std::uint32_t* origins, std::size_t origin_count,
                const MaskChunk* chunks, const std::uint32_t* offsets, std::size_t chunk_count,
                std::uint32_t* counts);
  // Moves the bits of each column down by 1 <= distance < 16 layers and fills with zeros. `planes`
  // contains layers 0..15, 16..31, ... as consecutive arrays of `columns` words.
  void (*lower)(std::uint16_t* planes, std::size_t plane_count, std::size_t columns,
                unsigned distance);
  // sums[n] += entering[n] - leaving[n].
  void (*slide)(std::uint16_t* sums, const std::uint16_t* entering, const std::uint16_t* leaving,
                std::size_t count);
  // Sums `length` values of `sums` from each index in `starts`. Reads up to 64 bytes more.
  void (*add_runs)(const std::uint16_t* sums, const std::uint32_t* starts, std::size_t start_count,
                   std::size_t length, std::uint32_t* totals);

  // Writes the voxel number of each point inside the box, in the order of the points, and returns
  // the number of values. `points` are coordinates, one array per axis. Up to `lanes` points after
  // the first `count` are read and treated alike; a caller that continues with them gets them
  // twice. `cells` needs room for count + lanes values.
  std::size_t (*find_cells)(const double* const points[3], std::size_t count,
                            const TiltedLattice& lattice, const TiltedBox& box, int* cells);
  // Returns the number of bits that are set in both `a` and `b`.
  std::uint32_t (*count_common)(const std::uint64_t* a, const std::uint64_t* b, std::size_t words);
};

// Returns the loops for an instruction set, which the processor must support.
const MatchingLoops& matching_loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
