#include "libgtd/score/voxel_matching.h"

#include <algorithm>
#include <limits>

#include "libgtd/score/matching_loops.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

// Counted bits of a window in chunks of 32 columns by 16 layers. Chunks without bits are skipped,
// and rows are clipped to columns with bits.
struct ChunkedMask {
  struct FirstBit {
    std::size_t plane = 0;  // layers 16 * plane ...
    std::size_t x = 0;
    std::size_t y = 0;
  };
  std::vector<MaskChunk> chunks;
  std::vector<FirstBit> first_bits;  // position of the first bit of each chunk
};

// Data of a gripper mask that are common to all blocks.
struct MatchingPlan {
  std::size_t side = 0;
  int pivot_xy = 0;
  int pivot_z = 0;
  int layers = 0;
  int bit_layers = 0;      // layers from the lowest to the highest with a bit
  bool counts_all = true;  // V = 1 everywhere: SSV is a box sum over columns
  ChunkedMask solid;       // V and M
  ChunkedMask counted;     // V, unless counts_all
};

// 16-bit numbers, aligned to a cache line and readable up to 64 bytes beyond the end.
class Lanes {
 public:
  void assign_zeros(std::size_t count) {
    lines_.assign(count / MaskChunk::columns + 2, MaskChunk{});
  }
  std::uint16_t* data() { return lines_.front().bits; }

 private:
  std::vector<MaskChunk> lines_;
};

// Scores one block after another and reuses its memory. The ground around the pivots of a block of
// columns is stored as bits that are shifted as the pivots ascend level by level.
class BlockMatcher {
 public:
  BlockMatcher(const VoxelGrid& grid, const MatchingPlan& plan, libmap::InstructionSet instructions)
      : grid_(grid), plan_(plan), loops_(matching_loops_of(instructions)) {}

  // Run of neighboring pivots: pivots[first .. last - 1].
  struct Run {
    std::size_t first = 0;
    std::size_t last = 0;
  };
  // Writes counts[n] for each index n in the runs. `pivots` are indices in grid.voxels.
  void match(const std::vector<std::size_t>& pivots, const Run* runs, std::size_t run_count,
             VoxelCounts* counts);

 private:
  // `column` is relative to the first column of the window.
  struct Ground {
    int k = 0;
    std::uint32_t column = 0;
  };
  struct Pivot {
    int k = 0;
    std::uint32_t column = 0;  // first column of the window of this pivot
    std::size_t index = 0;
  };
  void gather(const std::vector<std::size_t>& pivots, const Run* runs, std::size_t run_count);
  void make_offsets(const ChunkedMask& mask, std::vector<std::uint32_t>& offsets) const;
  void raise_to(int low);
  void count_level(std::size_t begin, std::size_t end, VoxelCounts* counts);
  void sum_boxes(std::size_t begin, std::size_t end, VoxelCounts* counts);

  const VoxelGrid& grid_;
  const MatchingPlan& plan_;
  const MatchingLoops& loops_;
  TileBounds columns_;  // columns of the window
  std::size_t width_ = 0;
  std::size_t size_ = 0;  // columns in the window
  std::size_t planes_ = 0;
  int low_ = 0;                                            // lowest layer of the window
  std::size_t entered_bits_ = 0, entered_ = 0, left_ = 0;  // processed entries of ground_
  std::vector<Pivot> pivots_, pivots_scratch_;             // ascending by k
  std::vector<Ground> ground_, ground_scratch_;
  Lanes bits_;      // planes of 16 layers of the columns of the window
  Lanes heights_;   // voxels per column in the window; a row of zeros follows
  Lanes row_sums_;  // per column: sums of `side` rows of heights
  std::vector<std::uint32_t> origins_, totals_;
  std::vector<std::uint32_t> solid_offsets_, counted_offsets_;
};

constexpr int layers_per_plane = 16;

// Returns the chunks of the bits for which wanted(x, y, z) is true.
template <typename Wanted>
ChunkedMask cut_into_chunks(const GripperMask& mask, const Wanted& wanted) {
  ChunkedMask cut;
  const auto column = [&](int plane, int x, int y) {
    unsigned bits = 0;
    const int first = plane * layers_per_plane;
    for (int z = first; z < std::min(mask.layers, first + layers_per_plane); ++z)
      bits |= wanted(x, y, z) ? 1U << (z - first) : 0U;
    return static_cast<std::uint16_t>(bits);
  };
  for (int plane = 0; plane * layers_per_plane < mask.layers; ++plane)
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y) {
        if (column(plane, x, y) == 0) continue;
        MaskChunk& chunk = cut.chunks.emplace_back();
        cut.first_bits.push_back({static_cast<std::size_t>(plane), static_cast<std::size_t>(x),
                                  static_cast<std::size_t>(y)});
        const int count = static_cast<int>(MaskChunk::columns);
        for (int c = 0; c < count; ++c)
          chunk.bits[c] = y + c < mask.side ? column(plane, x, y + c) : std::uint16_t{0};
        y += count - 1;
      }
  return cut;
}

int layers_of(const GripperMask& mask, const std::vector<std::uint8_t>& flags) {
  int layers = mask.layers;
  const auto layer_size = static_cast<std::ptrdiff_t>(mask.side) * mask.side;
  while (layers > 0 && std::none_of(flags.begin() + (layers - 1) * layer_size,
                                    flags.begin() + layers * layer_size,
                                    [](std::uint8_t flag) { return flag != 0; }))
    --layers;
  return layers;
}

// Stable sort by k, all in k_begin .. k_begin + levels - 1. Uses counting if the levels are dense,
// as those of a terrain are.
template <typename Entry>
void sort_by_level(int k_begin, std::size_t levels, std::vector<Entry>& entries,
                   std::vector<Entry>& scratch) {
  if (levels > 4 * entries.size() + 64) {
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.k < b.k; });
    return;
  }
  std::vector<std::uint32_t> ends(levels + 1, 0);
  for (const Entry& entry : entries) ++ends[static_cast<std::size_t>(entry.k - k_begin) + 1];
  for (std::size_t level = 1; level < levels; ++level) ends[level] += ends[level - 1];
  scratch.resize(entries.size());
  for (const Entry& entry : entries)
    scratch[ends[static_cast<std::size_t>(entry.k - k_begin)]++] = entry;
  entries.swap(scratch);
}

MatchingPlan plan_matching(const GripperMask& mask) {
  MatchingPlan plan;
  plan.side = static_cast<std::size_t>(mask.side);
  plan.pivot_xy = mask.pivot_xy;
  plan.pivot_z = mask.pivot_z;
  plan.layers = mask.layers;
  // Sums over a row of columns must fit 16 bits.
  plan.counts_all = static_cast<double>(mask.layers) * mask.side <= 0xffff &&
                    std::all_of(mask.counted.begin(), mask.counted.end(),
                                [](std::uint8_t flag) { return flag != 0; });
  plan.bit_layers = layers_of(mask, plan.counts_all ? mask.solid : mask.counted);
  plan.solid = cut_into_chunks(mask, [&](int x, int y, int z) {
    return mask.is_counted(x, y, z) && mask.is_solid(x, y, z);
  });
  if (!plan.counts_all)
    plan.counted =
        cut_into_chunks(mask, [&](int x, int y, int z) { return mask.is_counted(x, y, z); });
  return plan;
}

// Sets the columns of the window and collects the pivots of the block and the ground of their
// windows.
void BlockMatcher::gather(const std::vector<std::size_t>& pivots, const Run* runs,
                          std::size_t run_count) {
  const auto voxel_at = [&](std::size_t n) { return grid_.voxels[pivots[n]]; };
  const int below = plan_.pivot_xy;
  const int above = static_cast<int>(plan_.side) - below;
  columns_ = {voxel_at(runs[0].first).i - below, voxel_at(runs[run_count - 1].first).i + above,
              std::numeric_limits<int>::max(), std::numeric_limits<int>::min()};
  for (const Run* run = runs; run != runs + run_count; ++run) {
    columns_.j_begin = std::min(columns_.j_begin, voxel_at(run->first).j - below);
    columns_.j_end = std::max(columns_.j_end, voxel_at(run->last - 1).j + above);
  }
  width_ = static_cast<std::size_t>(columns_.j_end - columns_.j_begin);
  size_ = width_ * static_cast<std::size_t>(columns_.i_end - columns_.i_begin);

  pivots_.clear();
  int low = voxel_at(runs[0].first).k;
  int high = low;
  for (const Run* run = runs; run != runs + run_count; ++run) {
    const Voxel first = voxel_at(run->first);
    const std::size_t row = static_cast<std::size_t>(first.i - below - columns_.i_begin) * width_;
    for (std::size_t n = run->first; n < run->last; ++n) {
      const Voxel& voxel = grid_.voxels[pivots[n]];
      const auto column = static_cast<std::size_t>(voxel.j - below - columns_.j_begin);
      pivots_.push_back({voxel.k, static_cast<std::uint32_t>(row + column), n});
      low = std::min(low, voxel.k);
      high = std::max(high, voxel.k);
    }
  }
  sort_by_level(low, static_cast<std::size_t>(high - low) + 1, pivots_, pivots_scratch_);

  const int k_begin = low - plan_.pivot_z;
  const int k_end = high - plan_.pivot_z + plan_.layers;
  ground_.clear();
  visit_rows(grid_, columns_, [&](std::size_t first, std::size_t last) {
    const std::size_t row =
        static_cast<std::size_t>(grid_.voxels[first].i - columns_.i_begin) * width_;
    for (std::size_t at = first; at < last; ++at) {
      const Voxel& voxel = grid_.voxels[at];
      const auto column = static_cast<std::size_t>(voxel.j - columns_.j_begin);
      if (voxel.k >= k_begin && voxel.k < k_end)
        ground_.push_back({voxel.k, static_cast<std::uint32_t>(row + column)});
    }
  });
  sort_by_level(k_begin, static_cast<std::size_t>(k_end - k_begin), ground_, ground_scratch_);
}

void BlockMatcher::make_offsets(const ChunkedMask& mask,
                                std::vector<std::uint32_t>& offsets) const {
  offsets.clear();
  for (const ChunkedMask::FirstBit& first : mask.first_bits)
    offsets.push_back(static_cast<std::uint32_t>(first.plane * size_ + first.x * width_ + first.y));
}

// Moves the window up to the layer `low`: removes voxels below and adds voxels above.
void BlockMatcher::raise_to(int low) {
  int distance = low - low_;
  low_ = low;
  std::uint16_t* const bits = bits_.data();
  if (distance >= plan_.bit_layers) {
    std::fill_n(bits, planes_ * size_, std::uint16_t{0});
  } else {
    for (; distance >= layers_per_plane; distance -= layers_per_plane) {
      std::copy(bits + size_, bits + planes_ * size_, bits);
      std::fill_n(bits + (planes_ - 1) * size_, size_, std::uint16_t{0});
    }
    if (distance > 0) loops_.lower(bits, planes_, size_, static_cast<unsigned>(distance));
  }
  for (; entered_bits_ < ground_.size() && ground_[entered_bits_].k < low + plan_.bit_layers;
       ++entered_bits_) {
    const Ground& voxel = ground_[entered_bits_];
    if (voxel.k < low) continue;
    const auto layer = static_cast<std::size_t>(voxel.k - low);
    std::uint16_t& column = bits[layer / layers_per_plane * size_ + voxel.column];
    column = static_cast<std::uint16_t>(column | 1U << (layer % layers_per_plane));
  }
  if (!plan_.counts_all) return;
  std::uint16_t* const heights = heights_.data();
  for (; entered_ < ground_.size() && ground_[entered_].k < low + plan_.layers; ++entered_)
    ++heights[ground_[entered_].column];
  for (; left_ < ground_.size() && ground_[left_].k < low; ++left_)
    --heights[ground_[left_].column];
}

// SSV of the pivots begin .. end - 1, ascending by row: sums over side x side columns, from a row
// of running sums over `side` rows.
void BlockMatcher::sum_boxes(std::size_t begin, std::size_t end, VoxelCounts* counts) {
  const std::uint16_t* const heights = heights_.data();
  const std::uint16_t* const none = heights + size_;  // a row of zeros
  row_sums_.assign_zeros(width_);
  std::size_t row = pivots_[begin].column / width_;
  for (std::size_t x = 0; x < plan_.side; ++x)
    loops_.slide(row_sums_.data(), heights + (row + x) * width_, none, width_);
  for (std::size_t n = begin; n < end;) {
    const std::size_t next = pivots_[n].column / width_;
    for (; row < next; ++row)
      loops_.slide(row_sums_.data(), heights + (row + plan_.side) * width_, heights + row * width_,
                   width_);
    origins_.clear();
    const std::size_t first = n;
    for (; n < end && pivots_[n].column < (row + 1) * width_; ++n)
      origins_.push_back(static_cast<std::uint32_t>(pivots_[n].column - row * width_));
    loops_.add_runs(row_sums_.data(), origins_.data(), origins_.size(), plan_.side, totals_.data());
    for (std::size_t m = first; m < n; ++m) counts[pivots_[m].index].ssv = totals_[m - first];
  }
}

// Counts the pivots begin .. end - 1, which share a level.
void BlockMatcher::count_level(std::size_t begin, std::size_t end, VoxelCounts* counts) {
  raise_to(pivots_[begin].k - plan_.pivot_z);
  if (plan_.counts_all) sum_boxes(begin, end, counts);
  origins_.clear();
  for (std::size_t n = begin; n < end; ++n) origins_.push_back(pivots_[n].column);
  const auto count = [&](const ChunkedMask& mask, const std::vector<std::uint32_t>& offsets) {
    loops_.count(bits_.data(), origins_.data(), origins_.size(), mask.chunks.data(), offsets.data(),
                 offsets.size(), totals_.data());
  };
  count(plan_.solid, solid_offsets_);
  for (std::size_t n = begin; n < end; ++n) counts[pivots_[n].index].gsv = totals_[n - begin];
  if (plan_.counts_all) return;
  count(plan_.counted, counted_offsets_);
  for (std::size_t n = begin; n < end; ++n) counts[pivots_[n].index].ssv = totals_[n - begin];
}

void BlockMatcher::match(const std::vector<std::size_t>& pivots, const Run* runs,
                         std::size_t run_count, VoxelCounts* counts) {
  gather(pivots, runs, run_count);
  make_offsets(plan_.solid, solid_offsets_);
  make_offsets(plan_.counted, counted_offsets_);
  planes_ = static_cast<std::size_t>((plan_.bit_layers + layers_per_plane - 1) / layers_per_plane);
  bits_.assign_zeros(planes_ * size_);
  if (plan_.counts_all) heights_.assign_zeros(size_ + width_);
  totals_.resize(pivots_.size());
  entered_bits_ = entered_ = left_ = 0;
  low_ = pivots_.front().k - plan_.pivot_z;
  for (std::size_t begin = 0; begin < pivots_.size();) {
    std::size_t end = begin + 1;
    while (end < pivots_.size() && pivots_[end].k == pivots_[begin].k) ++end;
    count_level(begin, end, counts);
    begin = end;
  }
}

// Side of a block of pivots, in columns. The window fits the first two caches for typical masks,
// and most of it is not halo.
constexpr int block_columns = 80;

struct Blocks {
  std::vector<BlockMatcher::Run> runs;      // block after block
  std::vector<std::size_t> first_of_block;  // index in runs; with a sentinel at the end
};

// Groups the pivots by square blocks of columns. Pivots ascend, so that the pivots of one row in a
// block are adjacent. Blocks without pivots are not created.
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

double lowered(double percent, std::uint32_t ssv, int threshold) {
  if (ssv > static_cast<std::uint32_t>(threshold) || percent < 60.0) return percent;
  return percent - (static_cast<double>(threshold) - ssv) / threshold * 100.0;
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

std::size_t solid_chunks(const GripperMask& mask) {
  return plan_matching(mask).solid.chunks.size();
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

double score_percent(const VoxelCounts& counts, Method method, int solid_voxel_threshold) {
  if (counts.ssv == 0) return 0.0;
  switch (method) {
    case Method::thesis:
    case Method::envelope: {
      const float fraction = static_cast<float>(counts.gsv) / static_cast<float>(counts.ssv);
      const auto percent = static_cast<float>(static_cast<double>(fraction) * 100.0);
      return lowered(static_cast<double>(percent), counts.ssv, solid_voxel_threshold);
    }
    case Method::climblab:
      return 100.0 * counts.gsv / counts.ssv;
    case Method::corrected:
    case Method::calibrated:
      break;
  }
  return std::max(0.0, lowered(100.0 * counts.gsv / counts.ssv, counts.ssv, solid_voxel_threshold));
}

bool meets_threshold(const VoxelCounts& counts, double score, Method method,
                     int solid_voxel_threshold, double graspability_threshold) {
  if (method == Method::climblab)
    return counts.gsv == counts.ssv &&
           counts.ssv > static_cast<std::uint32_t>(solid_voxel_threshold);
  return score >= graspability_threshold;
}

}  // namespace libgtd
