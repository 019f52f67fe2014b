#include "libmap/camera/matrix_codec.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>

#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr std::size_t trailer_bytes = 12;
constexpr std::size_t piece_bytes = std::size_t{1} << 16;
constexpr int max_channels = 512;  // OpenCV's limit

void append_int32(std::string& bytes, std::int32_t value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string matrix_size_text(const StoredMatrix& matrix) {
  return std::to_string(matrix.rows) + " x " + std::to_string(matrix.columns) + " x " +
         std::to_string(static_cast<std::size_t>(matrix.channels) * bytes_of(matrix.element)) +
         " bytes";
}

std::uint64_t checked_bytes(const StoredMatrix& matrix, std::uint64_t stream_bytes) {
  const std::uint64_t most = stream_bytes * deflate_ratio;
  const std::uint64_t cells =
      static_cast<std::uint64_t>(matrix.rows) * static_cast<std::uint64_t>(matrix.columns);
  const std::uint64_t cell_bytes =
      static_cast<std::uint64_t>(matrix.channels) * bytes_of(matrix.element);
  if (cells > most / cell_bytes)
    throw Error(
        "more than " + std::to_string(stream_bytes) + " bytes of compressed data can contain",
        {.field = "size of the compressed matrix", .value = matrix_size_text(matrix)});
  return cells * cell_bytes;
}

struct InflateStream {
  explicit InflateStream(std::string_view bytes) {
    // zlib does not modify its input. Its 32-bit size is sufficient: SQLite has the same limit.
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    if (inflateInit(&stream) != Z_OK) throw Error("zlib failed to start", {}, ErrorKind::failed);
  }
  ~InflateStream() { inflateEnd(&stream); }
  InflateStream(const InflateStream&) = delete;
  InflateStream& operator=(const InflateStream&) = delete;

  z_stream stream{};
};

}  // namespace

std::size_t bytes_of(MatrixElement element) {
  constexpr std::array<std::size_t, 7> sizes{1, 1, 2, 2, 4, 4, 8};
  return sizes.at(static_cast<std::size_t>(element));
}

StoredMatrix read_matrix_header(std::string_view blob) {
  if (blob.size() <= trailer_bytes)
    throw Error("ends after " + std::to_string(blob.size()) + " bytes",
                {.field = "compressed matrix"});
  std::array<std::int32_t, 3> numbers{};
  std::memcpy(numbers.data(), blob.data() + blob.size() - trailer_bytes, trailer_bytes);
  const auto [rows, columns, type] = numbers;
  if (rows < 0 || columns < 0)
    throw Error("invalid", {.field = "size of the compressed matrix",
                            .value = std::to_string(rows) + " x " + std::to_string(columns)});
  if (type < 0 || (type & 7) > static_cast<int>(MatrixElement::float64) ||
      (type >> 3) + 1 > max_channels)
    throw Error("unsupported", {.field = "type of the compressed matrix",
                                .value = std::to_string(type),
                                .bound = "CV_8U to CV_64F, at most 512 channels"});
  return {.rows = rows,
          .columns = columns,
          .channels = (type >> 3) + 1,
          .element = static_cast<MatrixElement>(type & 7),
          .bytes = {}};
}

void for_each_matrix_chunk(std::string_view blob,
                           const std::function<void(std::string_view bytes)>& use) {
  const StoredMatrix matrix = read_matrix_header(blob);
  const std::string_view packed = blob.substr(0, blob.size() - trailer_bytes);
  const std::uint64_t wanted = checked_bytes(matrix, packed.size());
  InflateStream inflating(packed);
  z_stream& stream = inflating.stream;
  std::string piece(piece_bytes, '\0');
  std::uint64_t done = 0;
  for (int result = Z_OK; result != Z_STREAM_END;) {
    stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    stream.avail_out = static_cast<uInt>(piece.size());
    result = inflate(&stream, Z_NO_FLUSH);
    const std::size_t bytes = piece.size() - stream.avail_out;
    done += bytes;
    if (done > wanted)
      throw Error("less than the data",
                  {.field = "size of the compressed matrix", .value = matrix_size_text(matrix)});
    const bool is_at_end = result == Z_BUF_ERROR || (result == Z_OK && stream.avail_out > 0);
    if (is_at_end || (result == Z_STREAM_END && done < wanted))
      throw Error("damaged: the data end after " + std::to_string(done) + " of " +
                      std::to_string(wanted) + " bytes",
                  {.field = "compressed matrix"});
    if (result != Z_OK && result != Z_STREAM_END)
      throw Error("damaged: " + std::string(zError(result)), {.field = "compressed matrix"});
    if (bytes > 0) use(std::string_view(piece).substr(0, bytes));
  }
}

StoredMatrix decode_matrix(std::string_view blob) {
  StoredMatrix matrix = read_matrix_header(blob);
  const std::uint64_t wanted = checked_bytes(matrix, blob.size() - trailer_bytes);
  if (wanted > max_matrix_bytes)
    throw Error("too large", {.field = "size of the compressed matrix",
                              .value = matrix_size_text(matrix),
                              .bound = "<= " + std::to_string(max_matrix_bytes) + " bytes"});
  matrix.bytes.reserve(wanted);
  for_each_matrix_chunk(blob, [&](std::string_view bytes) { matrix.bytes += bytes; });
  return matrix;
}

std::string encode_matrix(const StoredMatrix& matrix) {
  const auto wanted = static_cast<uLong>(matrix.bytes.size());
  uLongf size = compressBound(wanted);
  std::string blob(size, '\0');
  const int result = compress(reinterpret_cast<Bytef*>(blob.data()), &size,
                              reinterpret_cast<const Bytef*>(matrix.bytes.data()), wanted);
  if (result != Z_OK)
    throw Error(std::string("matrix cannot be compressed: ") + zError(result), {},
                ErrorKind::failed);
  blob.resize(size);
  append_int32(blob, matrix.rows);
  append_int32(blob, matrix.columns);
  append_int32(blob, static_cast<std::int32_t>(matrix.element) + 8 * (matrix.channels - 1));
  return blob;
}

std::string decode_compressed_text(std::string_view blob) {
  StoredMatrix matrix = decode_matrix(blob);
  if (matrix.element != MatrixElement::int8 || matrix.channels != 1 || matrix.rows != 1)
    throw Error("is not a text", {.field = "compressed matrix"});
  std::string text = std::move(matrix.bytes);
  text.resize(std::strlen(text.c_str()));
  return text;
}

}  // namespace libmap
