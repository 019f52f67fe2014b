// The records of MCAP (https://mcap.dev/spec) as bytes: an opcode, the length of the content as
// uint64, the content; little-endian. Inner part of the MCAP reader and writer.
#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace libmap::mcap {

inline constexpr std::string_view magic("\x89MCAP0\r\n", 8);

// The kinds of records that are read or written.
enum class Opcode : std::uint8_t {
  header = 1,
  footer,
  schema,
  channel,
  message,
  chunk,
  message_index,
  chunk_index,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F
};

// Takes fields off the front of a record. Throws std::length_error where it ends too early.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : bytes_(bytes) {}

  bool empty() const { return bytes_.empty(); }
  std::string_view rest() const { return bytes_; }
  std::string_view take(std::uint64_t count) {
    if (count > bytes_.size()) throw std::length_error("a record ends too early");
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }
  template <typename T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  // Its length, of `Length`, then its bytes.
  template <typename Length = std::uint32_t>
  std::string_view text() {
    return take(number<Length>());
  }

 private:
  std::string_view bytes_;
};

// Puts fields behind one another.
class Record {
 public:
  template <typename T>
  Record& number(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  template <typename Length = std::uint32_t>
  Record& text(std::string_view text) {
    number(static_cast<Length>(text.size()));
    bytes_.append(text);
    return *this;
  }
  Record& bytes(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }

  std::string_view content() const { return bytes_; }
  // With opcode and length.
  std::string as(Opcode opcode) const {
    Record whole;
    whole.number(opcode).text<std::uint64_t>(bytes_);
    return whole.bytes_;
  }

 private:
  std::string bytes_;
};

// Compressed chunks (https://mcap.dev/spec/registry#well-known-compression-formats): frames of LZ4
// and Zstandard, by their libraries.
// `size` is what they are said to expand to. Memory grows with what they do expand to. Throws
// Error: another compression ("": none), broken, another size, more than 1 GiB.
std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size);
std::string compress_chunk(const std::string& compression, const std::string& bytes);

}  // namespace libmap::mcap
