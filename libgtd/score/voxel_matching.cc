#include "libgtd/score/voxel_matching.h"

#include <algorithm>
#include <cmath>

#include "libgtd/score/bit_count.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

// The voxels around a tile as rows of bits along j; the rows of one (i) lie side by side in k.
struct BitWindow {
  TileBounds columns;
  Voxel low;  // of the first bit
  std::size_t rows_per_i = 0;
  std::size_t words_per_row = 0;
  std::vector<std::uint64_t> bits;

  std::size_t row_of(int i, int k) const {
    return static_cast<std::size_t>(i - low.i) * rows_per_i + static_cast<std::size_t>(k - low.k);
  }
  double words() const {
    return static_cast<double>(columns.i_end - columns.i_begin) * static_cast<double>(rows_per_i) *
           static_cast<double>(words_per_row);
  }
  void set(const Voxel& voxel) {
    const auto bit = static_cast<std::size_t>(voxel.j - low.j);
    bits[row_of(voxel.i, voxel.k) * words_per_row + bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
};

struct KRange {
  int min = 0;
  int max = 0;
};

TileBounds with_halo(const TileBounds& tile, const GripperMask& mask) {
  const int below = mask.pivot_xy;
  const int above = mask.side - mask.pivot_xy - 1;
  return {tile.i_begin - below, tile.i_end + above, tile.j_begin - below, tile.j_end + above};
}

// Every window of a pivot lies in the box from its own k range, widened by the mask.
KRange k_range(const VoxelGrid& grid, const std::vector<std::size_t>& pivots) {
  KRange range{grid.voxels[pivots.front()].k, grid.voxels[pivots.front()].k};
  for (const std::size_t pivot : pivots) {
    range.min = std::min(range.min, grid.voxels[pivot].k);
    range.max = std::max(range.max, grid.voxels[pivot].k);
  }
  return range;
}

// The frame of a tile's window, its bits not yet allocated.
BitWindow frame_window(const VoxelGrid& grid, const GripperMask& mask, const TileBounds& tile,
                       const std::vector<std::size_t>& pivots) {
  const TileBounds columns = with_halo(tile, mask);
  const KRange pivots_k = k_range(grid, pivots);
  const int k_low = pivots_k.min - mask.pivot_z;
  const int k_high = pivots_k.max + mask.layers - mask.pivot_z - 1;
  BitWindow window;
  window.columns = columns;
  window.low = {columns.i_begin, columns.j_begin, k_low};
  window.rows_per_i = static_cast<std::size_t>(k_high - k_low) + 1;
  // A spare word at the end: count_bits reads one word beyond a row's last bit.
  window.words_per_row = static_cast<std::size_t>(columns.j_end - columns.j_begin) / 64 + 2;
  return window;
}

BitWindow make_window(const VoxelGrid& grid, const GripperMask& mask, const TileBounds& tile,
                      const std::vector<std::size_t>& pivots) {
  BitWindow window = frame_window(grid, mask, tile, pivots);
  window.bits.assign(static_cast<std::size_t>(window.words()), 0);
  const int k_end = window.low.k + static_cast<int>(window.rows_per_i);
  visit_columns(grid, window.columns, [&](std::size_t at) {
    const Voxel& voxel = grid.voxels[at];
    if (voxel.k >= window.low.k && voxel.k < k_end) window.set(voxel);
  });
  return window;
}

// The mask's rows, cut into words, without those that count nothing.
std::vector<MaskRow> make_rows(const GripperMask& mask, std::size_t rows_per_i) {
  std::vector<MaskRow> rows;
  for (int x = 0; x < mask.side; ++x)
    for (int z = 0; z < mask.layers; ++z)
      for (int first = 0; first < mask.side; first += 64) {
        MaskRow row;
        row.row_offset = static_cast<std::uint32_t>(static_cast<std::size_t>(x) * rows_per_i) +
                         static_cast<std::uint32_t>(z);
        row.bit_offset = static_cast<std::uint32_t>(first);
        for (int y = first; y < std::min(mask.side, first + 64); ++y) {
          const std::uint64_t bit = std::uint64_t{1} << (y - first);
          if (!mask.is_counted(x, y, z)) continue;
          row.counted |= bit;
          if (mask.is_solid(x, y, z)) row.solid |= bit;
        }
        if (row.counted != 0) rows.push_back(row);
      }
  return rows;
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

void require_window_room(const VoxelGrid& grid, const GripperMask& mask, const TileBounds& tile,
                         const std::vector<std::size_t>& pivots) {
  if (pivots.empty()) return;
  const double bytes = 8.0 * frame_window(grid, mask, tile, pivots).words();
  if (bytes > max_window_bytes)
    throw libmap::Error(
        "too small for this cloud and gripper: the window of one tile would take " +
            libmap::to_text(static_cast<float>(bytes / 0x1p30)) +
            " GiB at a bit a voxel, more than " + libmap::to_text(max_window_bytes / 0x1p30) +
            " GiB",
        {.field = "voxel_size_m", .value = libmap::to_text(grid.lattice.voxel_size_m)});
}

std::vector<VoxelCounts> match_voxels(const VoxelGrid& grid, const GripperMask& mask,
                                      const TileBounds& tile,
                                      const std::vector<std::size_t>& pivots) {
  if (pivots.empty()) return {};
  require_window_room(grid, mask, tile, pivots);
  const BitWindow window = make_window(grid, mask, tile, pivots);
  const std::vector<MaskRow> rows = make_rows(mask, window.rows_per_i);
  std::vector<VoxelCounts> counts;
  counts.reserve(pivots.size());
  for (const std::size_t at : pivots) {
    const Voxel& pivot = grid.voxels[at];
    const std::size_t first_row = window.row_of(pivot.i - mask.pivot_xy, pivot.k - mask.pivot_z);
    const auto first_bit = static_cast<std::size_t>(pivot.j - mask.pivot_xy - window.low.j);
    const BitCounts counted = count_bits(window.bits.data(), window.words_per_row, first_row,
                                         first_bit, rows.data(), rows.size());
    counts.push_back({counted.ssv, counted.gsv});
  }
  return counts;
}

std::vector<VoxelCounts> match_voxels_plainly(const VoxelGrid& grid, const GripperMask& mask,
                                              const std::vector<std::size_t>& pivots) {
  const int nx = grid.max.i - grid.min.i + 1;
  const int ny = grid.max.j - grid.min.j + 1;
  const int nz = grid.max.k - grid.min.k + 1;
  std::vector<int> dense(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny) *
                         static_cast<std::size_t>(nz));
  const auto cell = [&](int i, int j, int k) -> int* {
    if (i < 0 || i >= nx || j < 0 || j >= ny || k < 0 || k >= nz) return nullptr;
    return &dense[(static_cast<std::size_t>(i) * static_cast<std::size_t>(ny) +
                   static_cast<std::size_t>(j)) *
                      static_cast<std::size_t>(nz) +
                  static_cast<std::size_t>(k)];
  };
  for (const Voxel& voxel : grid.voxels)
    *cell(voxel.i - grid.min.i, voxel.j - grid.min.j, voxel.k - grid.min.k) = 1;
  std::vector<VoxelCounts> counts;
  for (const std::size_t at : pivots) {
    const Voxel& pivot = grid.voxels[at];
    VoxelCounts& count = counts.emplace_back();
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y)
        for (int z = 0; z < mask.layers; ++z) {
          const int* occupied = cell(pivot.i - grid.min.i - mask.pivot_xy + x,
                                     pivot.j - grid.min.j - mask.pivot_xy + y,
                                     pivot.k - grid.min.k - mask.pivot_z + z);
          if (occupied == nullptr || *occupied == 0 || !mask.is_counted(x, y, z)) continue;
          count.ssv += 1;
          if (mask.is_solid(x, y, z)) count.gsv += 1;
        }
  }
  return counts;
}

}  // namespace libgtd
