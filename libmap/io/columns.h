// Numbers in named columns: what the codecs of all formats read and write. A column is a view on
// memory that somebody else keeps, so that neither reading nor writing copies a cloud.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/core/text_lines.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

// How a number lies in memory. 64-bit integers are read as float64: exact up to 2^53.
enum class StoredType {
  int8,
  uint8,
  int16,
  uint16,
  int32,
  uint32,
  float32,
  float64,
  int64,
  uint64
};

// A type in a file, the other way round (64-bit integers become doubles), and the bytes of a
// number.
StoredType stored_as(ScalarType type);
ScalarType scalar_type_of(StoredType type);
std::size_t size_of(StoredType type);

struct Column {
  std::string name;
  ScalarType type = ScalarType::float32;    // as the file declares or is to declare it
  StoredType stored = StoredType::float32;  // as it lies in memory
  const std::byte* first = nullptr;         // of row 0
  std::size_t stride = 0;                   // bytes from row to row
  bool swapped = false;                     // the other byte order
};

struct ColumnSet {
  std::size_t rows = 0;
  std::vector<Column> columns;
  std::vector<std::shared_ptr<const void>> storage;  // keeps alive what the columns view

  const Column* find(std::string_view name) const;  // the column of that name, or nullptr
  // A new column of `rows` numbers to be filled; the set owns them.
  double* add_numbers(std::string name, ScalarType type);
};

// A file's whole content, as its codec yields it. Faces of more than three corners are cut into
// fans, and the fan's triangles share the face's row of `faces`.
struct GeometryColumns {
  GeometryFileInfo info;
  ColumnSet vertices;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> face_of_triangle;  // row of `faces`
  ColumnSet faces;
  std::optional<Pose> viewpoint;
};

// What a codec writes; the pointers may be null.
struct GeometryContent {
  const ColumnSet* vertices = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const ColumnSet* faces = nullptr;  // one row per triangle
  const Pose* viewpoint = nullptr;   // not written if it is the identity
};

// `value` as `type` holds it: integers rounded and brought into range, NaN as 0.
double as_type(double value, ScalarType type);
// Whether a file may say `value` for that type.
bool fits_type(double value, ScalarType type);

// Word `word` of a line as a number that fits `type`. Throws Error naming field and line.
double number_of(const TextLine& line, std::size_t word, const std::string& field, ScalarType type);

// Calls body(row, value) for each row.
template <typename Body>
void for_each_value(const Column& column, std::size_t rows, const Body& body);
// The same on all threads, in any order.
template <typename Body>
void for_each_value_in_parallel(const Column& column, std::size_t rows, const Body& body);

// Rows begin..end-1 one after another, each column as its `type`, without gaps.
void append_records(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                    bool swap_bytes, std::string& out);
std::size_t record_size(const std::vector<Column>& columns);
// The same as text, shortest form that reads back as the same number.
void append_rows_of_text(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                         char separator, std::string& out);
// All rows, block by block: append(begin, end, text) gives the bytes of some.
void write_rows(
    std::size_t rows, std::ostream& out,
    const std::function<void(std::size_t begin, std::size_t end, std::string& text)>& append);

// cloud_from_sensor in files: tx ty tz qw qx qy qz, as numbers and as words with a space before
// each.
std::array<double, 7> viewpoint_numbers(const Pose& viewpoint);
std::string viewpoint_words(const Pose& viewpoint);
// Nothing if the quaternion is zero.
std::optional<Pose> pose_of_viewpoint(const std::array<double, 7>& numbers);

inline constexpr std::size_t rows_a_chunk = 16384;  // that one thread takes

// body(row, value) for each row, in order; the numbers are stored as T.
template <typename T, typename Body>
void for_each_stored(const Column& column, std::size_t rows, const Body& body) {
  const std::byte* at = column.first;
  for (std::size_t row = 0; row < rows; ++row, at += column.stride) {
    std::array<std::byte, sizeof(T)> bytes;
    std::memcpy(bytes.data(), at, sizeof(T));
    if (column.swapped)
      for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
    body(row, static_cast<double>(std::bit_cast<T>(bytes)));
  }
}

// use(T{}), T being the type.
template <typename Use>
void with_type(StoredType type, const Use& use) {
  switch (type) {
    case StoredType::int8:
      return use(std::int8_t{});
    case StoredType::uint8:
      return use(std::uint8_t{});
    case StoredType::int16:
      return use(std::int16_t{});
    case StoredType::uint16:
      return use(std::uint16_t{});
    case StoredType::int32:
      return use(std::int32_t{});
    case StoredType::uint32:
      return use(std::uint32_t{});
    case StoredType::float32:
      return use(float{});
    case StoredType::float64:
      return use(double{});
    case StoredType::int64:
      return use(std::int64_t{});
    case StoredType::uint64:
      return use(std::uint64_t{});
  }
}

template <typename Body>
void for_each_value(const Column& column, std::size_t rows, const Body& body) {
  with_type(column.stored,
            [&](auto number) { for_each_stored<decltype(number)>(column, rows, body); });
}

template <typename Body>
void for_each_value_in_parallel(const Column& column, std::size_t rows, const Body& body) {
  parallel_for(rows, rows_a_chunk, [&](std::size_t begin, std::size_t end) {
    Column part = column;
    part.first += begin * part.stride;
    for_each_value(part, end - begin,
                   [&](std::size_t row, double value) { body(begin + row, value); });
  });
}

struct BinaryRecords {
  std::uint64_t begin = 0;  // of the first record in the file
  std::size_t bytes = 0;    // of a record
  std::uint64_t count = 0;
  std::vector<Column> columns;  // on a block of records that the caller keeps
  Pose viewpoint = Pose::Identity();
};

}  // namespace libmap
