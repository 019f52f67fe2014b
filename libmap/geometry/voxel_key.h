// Packs voxel indices into 64-bit keys, and maps keys to consecutive numbers by a hash table. For
// the fusion of depth images; inline, for innermost loops.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace libmap {

// Voxel of a grid. A grid cell has two voxels, one for each side of a thin sheet of surface.
struct VoxelSide {
  Eigen::Vector3i cell = Eigen::Vector3i::Zero();
  int side = 0;  // 0 or 1
};

// Keys exist for cell indices -voxel_cell_limit to voxel_cell_limit - 1 along each axis.
inline constexpr int voxel_cell_limit = 1 << 20;

// Layout of a key, from the highest bit: 21 bits each for x, y and z, and one bit for the side.
namespace voxel_key {

inline constexpr std::uint64_t axis_mask = (std::uint64_t{1} << 21U) - 1;
// Bits of the voxel's position in a block of 4 x 4 x 2 voxels.
inline constexpr std::uint64_t block_bits =
    std::uint64_t{3} << 43U | std::uint64_t{3} << 22U | std::uint64_t{1} << 1U;

inline std::uint64_t axis_bits(std::int64_t cell) {
  return static_cast<std::uint64_t>(cell + voxel_cell_limit) & axis_mask;
}

// Inserts two zeros before each of the 21 bits.
inline std::uint64_t spread(std::uint64_t bits) {
  bits &= axis_mask;
  bits = (bits | bits << 32U) & 0x1f00000000ffffU;
  bits = (bits | bits << 16U) & 0x1f0000ff0000ffU;
  bits = (bits | bits << 8U) & 0x100f00f00f00f00fU;
  bits = (bits | bits << 4U) & 0x10c30c30c30c30c3U;
  return (bits | bits << 2U) & 0x1249249249249249U;
}

inline std::size_t index_in_block(std::uint64_t key) {
  return static_cast<std::size_t>((key >> 1U & 1U) | (key >> 22U & 3U) << 1U |
                                  (key >> 43U & 3U) << 3U);
}

// The finalizer of SplitMix64 (Steele, Lea and Flood 2014).
inline std::uint64_t scramble(std::uint64_t key) {
  key = (key ^ (key >> 30U)) * 0xbf58476d1ce4e5b9U;
  key = (key ^ (key >> 27U)) * 0x94d049bb133111ebU;
  return key ^ (key >> 31U);
}

}  // namespace voxel_key

inline std::uint64_t pack(const VoxelSide& voxel) {  // returns the key; inverse: unpack()
  using voxel_key::axis_bits;
  return axis_bits(voxel.cell.x()) << 43U | axis_bits(voxel.cell.y()) << 22U |
         axis_bits(voxel.cell.z()) << 1U | static_cast<std::uint64_t>(voxel.side);
}

inline VoxelSide unpack(std::uint64_t key) {
  const auto cell = [](std::uint64_t bits) {
    return static_cast<int>(bits & voxel_key::axis_mask) - voxel_cell_limit;
  };
  return {{cell(key >> 43U), cell(key >> 22U), cell(key >> 1U)}, static_cast<int>(key & 1U)};
}

// Returns the position of a key on a Z-order curve (Morton 1966), which keeps neighbors close.
inline std::uint64_t z_order(std::uint64_t key) {
  return voxel_key::spread(key >> 43U) << 3U | voxel_key::spread(key >> 22U) << 2U |
         voxel_key::spread(key >> 1U) << 1U | (key & 1U);
}

// Hash table (open addressing) from keys to consecutive numbers in the order of insertion. Its
// entries are blocks of 4 x 4 x 2 voxels of one side, because neighbors are mostly in one block.
class VoxelIndex {
 public:
  static constexpr std::uint32_t none = 0xffffffff;  // number of a key that is not in the table

  VoxelIndex() : slots_(1U << 6U) {}  // no key yet

  // Returns the key's number, or `none`.
  std::uint32_t find(std::uint64_t key) const {
    const Slot& slot = slots_[slot_of(key & ~voxel_key::block_bits)];
    return slot.block == none ? none : blocks_[slot.block][voxel_key::index_in_block(key)];
  }

  // Returns the key's number; a new key gets the next number.
  std::uint32_t find_or_add(std::uint64_t key) {
    const std::uint64_t block_key = key & ~voxel_key::block_bits;
    if (block_key != last_key_ || last_block_ == none) {
      last_block_ = block_of(block_key);
      last_key_ = block_key;
    }
    std::uint32_t& number = blocks_[last_block_][voxel_key::index_in_block(key)];
    if (number != none) return number;
    keys_.push_back(key);
    return number = static_cast<std::uint32_t>(keys_.size() - 1);
  }

  std::size_t size() const { return keys_.size(); }
  const std::vector<std::uint64_t>& keys() const { return keys_; }  // by number
  std::vector<std::uint64_t> take_keys() && { return std::move(keys_); }

 private:
  using Block = std::array<std::uint32_t, 32>;  // numbers of the block's keys
  struct Slot {
    std::uint64_t key = 0;  // of a block
    std::uint32_t block = none;
  };

  std::size_t slot_of(std::uint64_t block_key) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = static_cast<std::size_t>(voxel_key::scramble(block_key)) & mask;
    while (slots_[slot].block != none && slots_[slot].key != block_key) slot = (slot + 1) & mask;
    return slot;
  }

  // Returns the block's number; adds the block if it is new.
  std::uint32_t block_of(std::uint64_t block_key) {
    Slot& slot = slots_[slot_of(block_key)];
    if (slot.block != none) return slot.block;
    const auto number = static_cast<std::uint32_t>(blocks_.size());
    slot = {block_key, number};
    blocks_.emplace_back().fill(none);
    if (2 * blocks_.size() > slots_.size()) grow();
    return number;
  }

  void grow() {
    std::vector<Slot> before(2 * slots_.size());
    before.swap(slots_);
    for (const Slot& slot : before)
      if (slot.block != none) slots_[slot_of(slot.key)] = slot;
  }

  std::vector<std::uint64_t> keys_;
  std::vector<Block> blocks_;
  std::vector<Slot> slots_;     // the size is a power of 2
  std::uint64_t last_key_ = 0;  // last block searched; adjacent pixels mostly share it
  std::uint32_t last_block_ = none;
};

}  // namespace libmap
