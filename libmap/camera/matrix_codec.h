// Reads and writes the compressed matrices and texts in RTAB-Map databases: a zlib stream, followed
// by three little-endian int32: rows, columns, OpenCV's type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// Type of an element, with OpenCV's codes (CV_8U to CV_64F).
enum class MatrixElement {
  uint8 = 0,
  int8 = 1,
  uint16 = 2,
  int16 = 3,
  int32 = 4,
  float32 = 5,
  float64 = 6
};
std::size_t bytes_of(MatrixElement element);  // bytes of one element

struct StoredMatrix {
  int rows = 0;
  int columns = 0;
  int channels = 1;
  MatrixElement element = MatrixElement::uint8;
  std::string bytes;  // rows * columns * channels elements, row by row, little-endian

  // Returns all elements in the order of `bytes`. T must have the size of `element`.
  template <typename T>
  std::vector<T> values() const {
    std::vector<T> list(bytes.size() / sizeof(T));
    if (!list.empty()) std::memcpy(list.data(), bytes.data(), list.size() * sizeof(T));
    return list;
  }

  bool operator==(const StoredMatrix&) const = default;
};

// Reads sizes and type from the end of a blob; `bytes` is empty. Throws Error if they are invalid.
StoredMatrix read_matrix_header(std::string_view blob);

// Maximum compression ratio of deflate (RFC 1951: 258 bytes in two bits).
inline constexpr std::uint64_t deflate_ratio = 1032;

// Maximum size for decode_matrix: 16 million float32, ten revolutions of a lidar of 128 x 2048.
inline constexpr std::uint64_t max_matrix_bytes = std::uint64_t{1} << 26;

// Decodes a matrix. Throws Error if the stream is damaged or does not have the declared size, or,
// before memory is allocated, if this size exceeds max_matrix_bytes or deflate_ratio * stream size.
StoredMatrix decode_matrix(std::string_view blob);
// Decodes a matrix of any size in constant memory, and calls `use` for each piece in order. All
// pieces except the last have a multiple of 8 bytes. Throws Error as decode_matrix does.
void for_each_matrix_chunk(std::string_view blob,
                           const std::function<void(std::string_view bytes)>& use);
// Encodes a matrix as the blob that decode_matrix reads.
std::string encode_matrix(const StoredMatrix& matrix);

// Decodes a text, which is one row of int8 ending with NUL. Throws Error for any other matrix.
std::string decode_compressed_text(std::string_view blob);

}  // namespace libmap
