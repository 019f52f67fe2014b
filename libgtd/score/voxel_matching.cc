#include "libgtd/score/voxel_matching.h"

#include <algorithm>

#include "libgtd/score/level_window.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

// Side of a block of pivots, in columns: its window stays in the first two caches for the masks
// that are in use, and is not all halo.
constexpr int block_columns = 80;

struct Blocks {
  std::vector<BlockMatcher::Run> runs;      // block after block
  std::vector<std::size_t> first_of_block;  // in runs; one more for the end
};

// Blocks lie on a lattice of their own. Pivots ascend, so that those of a row and a block follow
// each other; nothing is made for blocks without pivots.
Blocks cut_into_blocks(const VoxelGrid& grid, const std::vector<std::size_t>& pivots) {
  struct Piece {
    int row, column;  // of the block
    BlockMatcher::Run run;
  };
  std::vector<Piece> pieces;
  int i = 0;
  int j_end = 0;  // of the piece
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& voxel = grid.voxels[pivots[n]];
    if (pieces.empty() || voxel.i != i || voxel.j >= j_end) {
      if (!pieces.empty()) pieces.back().run.last = n;
      const int column = floor_divide(voxel.j, block_columns);
      pieces.push_back({floor_divide(voxel.i, block_columns), column, {n, pivots.size()}});
      i = voxel.i;
      j_end = (column + 1) * block_columns;
    }
  }
  std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
    return a.row != b.row ? a.row < b.row : a.column < b.column;
  });
  Blocks blocks;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (p == 0 || pieces[p].row != pieces[p - 1].row || pieces[p].column != pieces[p - 1].column)
      blocks.first_of_block.push_back(p);
    blocks.runs.push_back(pieces[p].run);
  }
  blocks.first_of_block.push_back(pieces.size());
  return blocks;
}

}  // namespace

std::vector<std::size_t> pivots_in(const VoxelGrid& grid, const GripperMask& mask,
                                   const TileBounds& tile) {
  TileBounds inner = tile;
  if (mask.method != Method::corrected) {
    const int h = mask.pivot_xy;
    inner.i_begin = std::max(inner.i_begin, grid.min.i + h + 1);
    inner.i_end = std::min(inner.i_end, grid.max.i - h);
    inner.j_begin = std::max(inner.j_begin, grid.min.j + h + 1);
    inner.j_end = std::min(inner.j_end, grid.max.j - h);
  }
  std::vector<std::size_t> pivots;
  visit_columns(grid, inner, [&](std::size_t at) { pivots.push_back(at); });
  return pivots;
}

std::vector<VoxelCounts> match_voxels(const VoxelGrid& grid, const GripperMask& mask,
                                      const std::vector<std::size_t>& pivots,
                                      libmap::InstructionSet instructions,
                                      libmap::Progress& progress) {
  const MatchingPlan plan = plan_matching(mask);
  const Blocks blocks = cut_into_blocks(grid, pivots);
  std::vector<VoxelCounts> counts(pivots.size());
  const std::size_t count = blocks.first_of_block.size() - 1;
  progress.begin("voxel matching", count);
  libmap::parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    BlockMatcher matcher(grid, plan, instructions);
    for (std::size_t b = begin; b < end; ++b) {
      const std::size_t first = blocks.first_of_block[b];
      matcher.match(pivots, &blocks.runs[first], blocks.first_of_block[b + 1] - first,
                    counts.data());
      progress.advance(1);
    }
  });
  progress.end();
  return counts;
}

}  // namespace libgtd
