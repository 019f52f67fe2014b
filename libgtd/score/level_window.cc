#include "libgtd/score/level_window.h"

#include <algorithm>
#include <limits>

#include "libgtd/score/voxel_matching.h"

namespace libgtd {

namespace {

constexpr int layers_per_plane = 16;

// The chunks of the bits that wanted(x, y, z) names.
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
        cut.places.push_back({static_cast<std::size_t>(plane), static_cast<std::size_t>(x),
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

// Stable; all of k_begin .. k_begin + levels - 1. Levels that lie close together, as a terrain's
// do, are sorted by counting.
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

}  // namespace

MatchingPlan plan_matching(const GripperMask& mask) {
  MatchingPlan plan;
  plan.side = static_cast<std::size_t>(mask.side);
  plan.pivot_xy = mask.pivot_xy;
  plan.pivot_z = mask.pivot_z;
  plan.layers = mask.layers;
  // The sum over a row of columns must fit 16 bits.
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

// Sets the window's columns and collects the block's pivots and the ground of their windows.
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
  for (const ChunkedMask::Place& place : mask.places)
    offsets.push_back(static_cast<std::uint32_t>(place.plane * size_ + place.x * width_ + place.y));
}

// Moves the window up to the layer `low`: what falls out below goes, what comes in above enters.
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

// SSV of the pivots begin .. end - 1, ascending by row: sums over side x side columns, by a row of
// running sums over `side` rows.
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
    for (std::size_t m = first; m < n; ++m) counts[pivots_[m].place].ssv = totals_[m - first];
  }
}

// The pivots begin .. end - 1, which share a level.
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
  for (std::size_t n = begin; n < end; ++n) counts[pivots_[n].place].gsv = totals_[n - begin];
  if (plan_.counts_all) return;
  count(plan_.counted, counted_offsets_);
  for (std::size_t n = begin; n < end; ++n) counts[pivots_[n].place].ssv = totals_[n - begin];
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

}  // namespace libgtd
