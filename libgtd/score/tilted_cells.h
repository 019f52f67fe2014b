// The innermost loops of matching with a tilted mask, for several instruction sets, with the same
// bits from each. Plain pointers alone, as in shape/neighbor_loops.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libgtd {

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

struct TiltedLoops {
  static constexpr std::size_t lanes = 8;

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
const TiltedLoops& tilted_loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
