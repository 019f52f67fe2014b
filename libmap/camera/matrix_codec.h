// Matrices and texts as RTAB-Map compresses them: a zlib stream, then rows, columns and OpenCV's
// type as int32, little-endian.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// OpenCV's depth numbers.
enum class MatrixElement {
  uint8 = 0,
  int8 = 1,
  uint16 = 2,
  int16 = 3,
  int32 = 4,
  float32 = 5,
  float64 = 6
};
std::size_t bytes_of(MatrixElement element);

struct StoredMatrix {
  int rows = 0;
  int columns = 0;
  int channels = 1;
  MatrixElement element = MatrixElement::uint8;
  std::string bytes;  // rows * columns * channels elements, row by row, little-endian

  // All elements, in the order of `bytes`; T must have the size of `element`.
  template <typename T>
  std::vector<T> values() const {
    std::vector<T> list(bytes.size() / sizeof(T));
    if (!list.empty()) std::memcpy(list.data(), bytes.data(), list.size() * sizeof(T));
    return list;
  }

  bool operator==(const StoredMatrix&) const = default;
};

// Sizes and type from a blob's end, without its bytes. Throws Error if they are none.
StoredMatrix read_matrix_header(std::string_view blob);

// deflate packs at most 1032 bytes into one (RFC 1951: 258 bytes in two bits).
inline constexpr std::uint64_t deflate_ratio = 1032;

// The most that decode_matrix takes: 16 million float32, ten turns of a lidar of 128 x 2048 points.
inline constexpr std::uint64_t max_matrix_bytes = std::uint64_t{1} << 26;

// Sizes are checked before memory is taken: at most max_matrix_bytes, and no more than the stream
// can hold. Throws Error for a broken stream or one of another length than its sizes say.
StoredMatrix decode_matrix(std::string_view blob);
// The same bytes, of any number, in pieces of a multiple of 8 bytes but the last: memory for one.
void each_matrix_piece(std::string_view blob,
                       const std::function<void(std::string_view bytes)>& use);
std::string encode_matrix(const StoredMatrix& matrix);

// A text as a matrix of one row of int8 that ends with NUL.
std::string decode_compressed_text(std::string_view blob);

}  // namespace libmap
