// The blocks of binary data in a VTK XML file: raw or base64, plain or compressed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace libmap {

struct BlockLayout {
  std::uint64_t word_bytes = 4;  // of a number in a block's header
  bool big_endian = false;
  std::string compressor;  // VTK's class; empty for none
};

// A block and all that follows it in the file.
struct BlockPlace {
  std::string_view data;
  bool base64 = false;
};

// How many bytes the block holds when unpacked. Throws Error if its header claims more than the
// file holds, or no whole numbers of `number_bytes`.
std::uint64_t block_length(const BlockPlace& place, const BlockLayout& layout,
                           std::uint64_t number_bytes);

// The block, unpacked. Throws Error as block_length does, and if it cannot be unpacked.
std::string unpack_block(const BlockPlace& place, const BlockLayout& layout,
                         std::uint64_t number_bytes);

}  // namespace libmap
