// The ground around the pivots of one block of columns, as bits that follow the pivots upward level
// by level; for voxel_matching.cc alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/score/bit_count.h"
#include "libgtd/terrain/voxel_grid.h"

namespace libgtd {

// Which bits of a window count, cut into chunks of 32 columns by 16 layers. Chunks that hold no bit
// are left out, and rows are cut to the columns that do.
struct ChunkedMask {
  struct Place {
    std::size_t plane = 0;  // layers 16 * plane ...
    std::size_t x = 0;
    std::size_t y = 0;
  };
  std::vector<MaskChunk> chunks;
  std::vector<Place> places;  // of each chunk's first bit
};

// What the loops need of a gripper mask, whatever the block.
struct MatchingPlan {
  std::size_t side = 0;
  int pivot_xy = 0;
  int pivot_z = 0;
  int layers = 0;
  int bit_layers = 0;      // layers from the lowest on that hold a bit of a chunk
  bool counts_all = true;  // V = 1: SSV is a sum over boxes of columns, without a mask
  ChunkedMask solid;       // V and M
  ChunkedMask counted;     // V, unless counts_all
};
MatchingPlan plan_matching(const GripperMask& mask);

struct VoxelCounts;

// Numbers of 16 bits that begin at a cache line and may be read up to 64 bytes beyond their end.
class Lanes {
 public:
  void assign_zeros(std::size_t count) {
    lines_.assign(count / MaskChunk::columns + 2, MaskChunk{});
  }
  std::uint16_t* data() { return lines_.front().bits; }

 private:
  std::vector<MaskChunk> lines_;
};

// Scores blocks one after the other; keeps its memory for the next one.
class BlockMatcher {
 public:
  BlockMatcher(const VoxelGrid& grid, const MatchingPlan& plan, libmap::InstructionSet instructions)
      : grid_(grid), plan_(plan), loops_(loops_of(instructions)) {}

  // A run of neighboring pivots: the places first .. last - 1 of `pivots`.
  struct Run {
    std::size_t first = 0;
    std::size_t last = 0;
  };
  // Writes counts[n] for each place n in the runs of `pivots`, positions in grid.voxels.
  void match(const std::vector<std::size_t>& pivots, const Run* runs, std::size_t run_count,
             VoxelCounts* counts);

 private:
  // `column` counts from the window's first one.
  struct Ground {
    int k = 0;
    std::uint32_t column = 0;
  };
  struct Pivot {
    int k = 0;
    std::uint32_t column = 0;  // the first of the pivot's own window
    std::size_t place = 0;
  };
  void gather(const std::vector<std::size_t>& pivots, const Run* runs, std::size_t run_count);
  void make_offsets(const ChunkedMask& mask, std::vector<std::uint32_t>& offsets) const;
  void raise_to(int low);
  void count_level(std::size_t begin, std::size_t end, VoxelCounts* counts);
  void sum_boxes(std::size_t begin, std::size_t end, VoxelCounts* counts);

  const VoxelGrid& grid_;
  const MatchingPlan& plan_;
  const BitLoops& loops_;
  TileBounds columns_;  // of the window
  std::size_t width_ = 0;
  std::size_t size_ = 0;  // columns in the window
  std::size_t planes_ = 0;
  int low_ = 0;                                            // the window's lowest layer
  std::size_t entered_bits_ = 0, entered_ = 0, left_ = 0;  // how many of ground_ so far
  std::vector<Pivot> pivots_, pivots_scratch_;             // ascending by k
  std::vector<Ground> ground_, ground_scratch_;
  Lanes bits_;      // planes of 16 layers of the window's columns
  Lanes heights_;   // how many voxels of each column are in the window; a row of zeros follows
  Lanes row_sums_;  // of the columns, over `side` rows of heights
  std::vector<std::uint32_t> origins_, totals_;
  std::vector<std::uint32_t> solid_offsets_, counted_offsets_;
};

}  // namespace libgtd
