#include "libmap/cloud/vtp_blocks.h"

#include <vtkDataCompressor.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkLZMADataCompressor.h>
#include <vtkSmartPointer.h>
#include <vtkZLibDataCompressor.h>

#include <algorithm>
#include <vector>

#include "libmap/core/error.h"

namespace libmap {
namespace {

// zlib unpacks at most 1032 bytes of one.
constexpr std::uint64_t max_ratio = 1032;

void require_block(bool sane) {
  if (!sane) throw Error("a block of data claims more than the file holds");
}

int base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

// The first `count` bytes of base64 text; fewer if it ends or is none.
std::string base64_prefix(std::string_view text, std::uint64_t count) {
  std::string bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = base64_value(c);
    if (value < 0 || bytes.size() >= count) break;
    bits = (bits << 6 | static_cast<std::uint32_t>(value)) & 0xFFFFFF;
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes += static_cast<char>(bits >> held & 0xFF);
  }
  return bytes.substr(0, count);
}

std::uint64_t word_at(const std::string& bytes, std::uint64_t index, const BlockLayout& layout) {
  require_block((index + 1) * layout.word_bytes <= bytes.size());
  std::uint64_t word = 0;
  for (std::uint64_t i = 0; i < layout.word_bytes; ++i) {
    const std::uint64_t from = layout.big_endian ? i : layout.word_bytes - 1 - i;
    word = word << 8 | static_cast<unsigned char>(bytes[index * layout.word_bytes + from]);
  }
  return word;
}

// What stands before compressed data.
struct Pieces {
  std::uint64_t full = 0;  // bytes of a whole piece
  std::uint64_t last = 0;  // bytes of the last piece, 0 if it is whole
  std::vector<std::uint64_t> packed;

  std::uint64_t unpacked(std::size_t i) const {
    return i + 1 == packed.size() && last > 0 ? last : full;
  }
  std::uint64_t length() const {
    return packed.empty() ? 0 : (packed.size() - 1) * full + unpacked(packed.size() - 1);
  }
};

std::string head_of(const BlockPlace& place, std::uint64_t bytes) {
  return place.base64 ? base64_prefix(place.data, bytes) : std::string(place.data.substr(0, bytes));
}

std::uint64_t room_of(const BlockPlace& place) {
  return place.base64 ? place.data.size() / 4 * 3 + 3 : place.data.size();
}

Pieces read_pieces(const BlockPlace& place, const BlockLayout& layout, std::uint64_t number_bytes) {
  const std::string sizes = head_of(place, 3 * layout.word_bytes);
  // An array without data may have a header of one word.
  const std::uint64_t count = word_at(sizes, 0, layout);
  if (count == 0) return {};
  Pieces pieces{word_at(sizes, 1, layout), word_at(sizes, 2, layout), {}};
  const std::uint64_t room = room_of(place);
  const std::uint64_t most = room * max_ratio;
  require_block(count <= room / layout.word_bytes && pieces.full > 0 && pieces.full <= most &&
                pieces.last <= pieces.full && pieces.full % number_bytes == 0 &&
                pieces.last % number_bytes == 0 && count <= most / pieces.full + 1);
  const std::string all = head_of(place, (3 + count) * layout.word_bytes);
  std::uint64_t left = room;
  for (std::uint64_t i = 0; i < count; ++i) {
    pieces.packed.push_back(word_at(all, 3 + i, layout));
    require_block(pieces.packed.back() <= left);
    left -= pieces.packed.back();
  }
  return pieces;
}

vtkSmartPointer<vtkDataCompressor> make_compressor(const std::string& name) {
  if (name == "vtkZLibDataCompressor") return vtkSmartPointer<vtkZLibDataCompressor>::New();
  if (name == "vtkLZ4DataCompressor") return vtkSmartPointer<vtkLZ4DataCompressor>::New();
  if (name == "vtkLZMADataCompressor") return vtkSmartPointer<vtkLZMADataCompressor>::New();
  throw Error("unknown compressor",
              {.file = {}, .field = "compressor", .value = name.substr(0, 60), .bound = {}});
}

// The compressed data behind the block's header. In base64 the header is a text of its own.
std::string packed_data(const BlockPlace& place, std::uint64_t header_bytes,
                        std::uint64_t packed_bytes) {
  const std::uint64_t header = place.base64 ? (header_bytes + 2) / 3 * 4 : header_bytes;
  require_block(header <= place.data.size());
  return head_of({place.data.substr(header), place.base64}, packed_bytes);
}

}  // namespace

std::uint64_t block_length(const BlockPlace& place, const BlockLayout& layout,
                           std::uint64_t number_bytes) {
  if (!layout.compressor.empty()) return read_pieces(place, layout, number_bytes).length();
  const std::uint64_t length = word_at(head_of(place, layout.word_bytes), 0, layout);
  require_block(length <= room_of(place) && length % number_bytes == 0);
  return length;
}

std::string unpack_block(const BlockPlace& place, const BlockLayout& layout,
                         std::uint64_t number_bytes) {
  if (layout.compressor.empty()) {
    const std::uint64_t length = block_length(place, layout, number_bytes);
    const std::string all = head_of(place, layout.word_bytes + length);
    require_block(all.size() == layout.word_bytes + length);
    return all.substr(layout.word_bytes);
  }
  const Pieces pieces = read_pieces(place, layout, number_bytes);
  std::uint64_t packed_bytes = 0;
  for (const std::uint64_t packed : pieces.packed) packed_bytes += packed;
  const std::string data =
      packed_data(place, (3 + pieces.packed.size()) * layout.word_bytes, packed_bytes);
  require_block(data.size() == packed_bytes);
  const vtkSmartPointer<vtkDataCompressor> compressor = make_compressor(layout.compressor);
  std::string bytes(pieces.length(), '\0');
  std::size_t from = 0;
  std::size_t to = 0;
  for (std::size_t i = 0; i < pieces.packed.size(); ++i) {
    const std::size_t length = pieces.unpacked(i);
    if (compressor->Uncompress(
            reinterpret_cast<const unsigned char*>(data.data()) + from, pieces.packed[i],
            reinterpret_cast<unsigned char*>(bytes.data()) + to, length) != length)
      throw Error("a block of data cannot be unpacked");
    from += pieces.packed[i];
    to += length;
  }
  return bytes;
}

}  // namespace libmap
