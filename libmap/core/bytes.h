// Reads and writes consecutive little-endian numbers, for binary file formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// Reads numbers from the front of a byte string, which must outlive the reader and the returned
// views. Throws std::length_error if too few bytes remain.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  bool empty() const { return bytes_.empty(); }
  std::string_view rest() const { return bytes_; }  // bytes that are not read yet
  std::string_view take(std::uint64_t count) {      // returns the next `count` bytes
    if (count > bytes_.size()) throw std::length_error("too few bytes");
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }
  // Reads a number or a trivially copyable struct.
  template <typename T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  // Reads `count` numbers; the length is checked before the allocation.
  template <typename T>
  std::vector<T> numbers(std::int64_t count) {
    if (count < 0 || static_cast<std::uint64_t>(count) > bytes_.size() / sizeof(T))
      throw std::length_error("too few bytes");
    std::vector<T> values(static_cast<std::size_t>(count));
    const std::string_view taken = take(values.size() * sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), taken.data(), taken.size());
    return values;
  }
  // Reads a length of type `Length`, then that many bytes.
  template <typename Length = std::uint32_t>
  std::string_view text() {
    return take(number<Length>());
  }

 private:
  std::string_view bytes_;
};

// Appends numbers and texts to a byte string, as ByteReader reads them. numbers() writes no count.
class ByteWriter {
 public:
  template <typename T>
  ByteWriter& number(const T& value) {
    return bytes({reinterpret_cast<const char*>(&value), sizeof value});
  }
  template <typename T>
  ByteWriter& numbers(const std::vector<T>& values) {
    return bytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  template <typename Length = std::uint32_t>
  ByteWriter& text(std::string_view text) {
    return number(static_cast<Length>(text.size())).bytes(text);
  }
  ByteWriter& bytes(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }

  const std::string& content() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace libmap
