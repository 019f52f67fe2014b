#include "libgtd/score/tiling.h"

#include <algorithm>
#include <map>
#include <utility>

#include "libgtd/score/closing_force.h"
#include "libgtd/score/scanned_area.h"
#include "libgtd/score/voxel_matching.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr std::size_t pivots_per_chunk = 4096;

constexpr std::uint8_t is_pivot = 1;
constexpr std::uint8_t is_border = 2;

// Flags per voxel of the grid: pivot of the tiles (is_pivot), and pivot at the border (is_border).
std::vector<std::uint8_t> find_pivots(const VoxelGrid& grid, const GripperMask& mask,
                                      const std::vector<TileBounds>& tiles) {
  std::vector<std::uint8_t> flags(grid.voxels.size(), 0);
  // The other methods do not score the border.
  const bool flag_edges = mask.method == Method::corrected;
  libmap::parallel_each(tiles.size(), [&](std::size_t t) {
    const std::vector<std::size_t> pivots = pivots_in(grid, mask, tiles[t]);
    for (const std::size_t at : pivots) flags[at] = is_pivot;
    if (!flag_edges) return;
    const std::vector<std::uint8_t> edges = find_border_pivots(grid, mask, tiles[t], pivots);
    for (std::size_t n = 0; n < pivots.size(); ++n)
      if (edges[n] != 0) flags[pivots[n]] |= is_border;
  });
  return flags;
}

// Groups indices in `pivots` by block of columns, ascending. The memory of a wide tile with few
// voxels is proportional to its voxels, not to its width.
std::vector<std::vector<std::size_t>> blocks_of(const VoxelGrid& grid, const TileBounds& tile,
                                                const std::vector<std::size_t>& pivots) {
  constexpr int block_columns = 1024;
  std::map<std::pair<int, int>, std::vector<std::size_t>> blocks;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& voxel = grid.voxels[pivots[n]];
    blocks[{(voxel.i - tile.i_begin) / block_columns, (voxel.j - tile.j_begin) / block_columns}]
        .push_back(n);
  }
  std::vector<std::vector<std::size_t>> listed;
  listed.reserve(blocks.size());
  for (auto& [corner, members] : blocks) listed.push_back(std::move(members));
  return listed;
}

}  // namespace

std::vector<TileBounds> make_tiles(const VoxelGrid& grid, int tile_voxels) {
  if (grid.voxels.empty()) return {};
  const int i_first = floor_divide(grid.min.i, tile_voxels);
  const int i_last = floor_divide(grid.max.i, tile_voxels);
  const int j_first = floor_divide(grid.min.j, tile_voxels);
  const int j_last = floor_divide(grid.max.j, tile_voxels);
  const double count = (1.0 + i_last - i_first) * (1.0 + j_last - j_first);
  if (count > 0x1p24)
    throw libmap::Error("too small: the map would have " + libmap::to_text(count) + " tiles",
                        {.field = "tile_size_m",
                         .value = libmap::to_text(tile_voxels * grid.lattice.voxel_size_m)});
  std::vector<TileBounds> tiles;
  tiles.reserve(static_cast<std::size_t>(count));
  for (int i = i_first; i <= i_last; ++i)
    for (int j = j_first; j <= j_last; ++j)
      // Clipped to the grid, so that a tile takes no more memory than the columns of the grid.
      tiles.push_back(
          {std::max(i * tile_voxels, grid.min.i), std::min((i + 1) * tile_voxels, grid.max.i + 1),
           std::max(j * tile_voxels, grid.min.j), std::min((j + 1) * tile_voxels, grid.max.j + 1)});
  return tiles;
}

std::vector<std::uint8_t> find_border_pivots(const VoxelGrid& grid, const GripperMask& mask,
                                             const TileBounds& tile,
                                             const std::vector<std::size_t>& pivots) {
  const int below = mask.pivot_xy;
  const int above = mask.side - mask.pivot_xy - 1;
  std::vector<std::uint8_t> edges(pivots.size(), 0);
  for (const std::vector<std::size_t>& block : blocks_of(grid, tile, pivots)) {
    TileBounds columns = columns_around(grid.voxels[pivots[block.front()]].i,
                                        grid.voxels[pivots[block.front()]].j, 0, 0);
    for (const std::size_t n : block) {
      const Voxel& voxel = grid.voxels[pivots[n]];
      columns = {std::min(columns.i_begin, voxel.i), std::max(columns.i_end, voxel.i + 1),
                 std::min(columns.j_begin, voxel.j), std::max(columns.j_end, voxel.j + 1)};
    }
    const ColumnSums unscanned = unscanned_columns(grid, expanded(columns, below, above));
    for (const std::size_t n : block) {
      const Voxel& voxel = grid.voxels[pivots[n]];
      edges[n] = unscanned.count(columns_around(voxel.i, voxel.j, below, above)) != 0 ? 1 : 0;
    }
  }
  return edges;
}

std::vector<ScoredVoxel> score_tiles(const VoxelGrid& grid, const GripperMask& mask,
                                     const std::vector<TileBounds>& tiles,
                                     const ScoringOptions& options, libmap::Progress& progress) {
  const std::vector<std::uint8_t> flags = find_pivots(grid, mask, tiles);
  std::vector<std::size_t> pivots;
  pivots.reserve(flags.size());
  for (std::size_t at = 0; at < flags.size(); ++at)
    if (flags[at] != 0) pivots.push_back(at);
  const std::vector<VoxelCounts> counts =
      match_voxels(grid, mask, pivots, options.instructions, progress);
  std::vector<ForceEstimate> forces;
  std::vector<double> fractions;  // corrected only
  if (mask.closing)
    forces = closing_forces(grid, *mask.closing, pivots);
  else if (mask.method == Method::corrected)
    fractions = outward_fall_fractions(grid, mask, pivots);
  std::vector<ScoredVoxel> scored(pivots.size());
  libmap::parallel_each(pivots.size(), pivots_per_chunk, [&](std::size_t n) {
    ScoredVoxel& one = scored[n];
    one.voxel = grid.voxels[pivots[n]];
    one.counts = counts[n];
    if (mask.closing) {
      one.force = forces[n];
      one.score = forces[n].hold_probability;
    } else {
      if (!fractions.empty()) one.outward_fall_fraction = fractions[n];
      one.score = score_percent(counts[n], mask.method, options.solid_voxel_threshold) / 100.0 *
                  one.outward_fall_fraction;
    }
    one.border = (flags[pivots[n]] & is_border) != 0;
  });
  return scored;
}

}  // namespace libgtd
