// Named columns of numbers: the common format between file codecs and clouds or meshes. A column
// refers to memory that another object owns, so that reading and writing do not copy a cloud.
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

// Type of a number in memory. 64-bit integers are read as float64: exact up to 2^53.
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

// Returns the type in memory of numbers whose type in a file is `type`.
StoredType stored_as(ScalarType type);
// Inverse of stored_as; float64 for 64-bit integers.
ScalarType scalar_type_of(StoredType type);
std::size_t size_of(StoredType type);  // size of a number in bytes

struct Column {
  std::string name;
  ScalarType type = ScalarType::float32;    // declared type in the file
  StoredType stored = StoredType::float32;  // type in memory
  const std::byte* first = nullptr;         // address of row 0
  std::size_t stride = 0;                   // bytes from one row to the next
  bool swapped = false;                     // true: opposite of this machine's byte order
};

struct ColumnSet {
  std::size_t rows = 0;  // number of rows of each column
  std::vector<Column> columns;
  std::vector<std::shared_ptr<const void>> storage;  // owners of memory of the columns, if any

  const Column* find(std::string_view name) const;  // nullptr if there is no such column
  // Adds a column of `rows` numbers, owned by the set. Returns a pointer to row 0, to fill them.
  double* add_numbers(std::string name, ScalarType type);
};

// Decoded content of a file. Faces with more than three corners are split into triangle fans; the
// triangles of a fan share the face's row of `faces`.
struct GeometryColumns {
  GeometryFileInfo info;
  ColumnSet vertices;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> face_of_triangle;  // row of `faces` of each triangle
  ColumnSet faces;                              // scalar fields of the faces
  std::optional<Pose> viewpoint;                // cloud_from_sensor; nullopt: not in the file
};

// Content to encode. Pointers other than `vertices` can be null.
struct GeometryContent {
  const ColumnSet* vertices = nullptr;
  const std::vector<Triangle>* triangles = nullptr;  // null for a cloud
  const ColumnSet* faces = nullptr;                  // scalar fields, one row per triangle
  const Pose* viewpoint = nullptr;  // cloud_from_sensor; not written if it is the identity
};

// Returns the value nearest to `value` that `type` can store. In integer types, NaN becomes 0.
double as_type(double value, ScalarType type);
// True if `type` can represent `value`; always true for float types.
bool fits_type(double value, ScalarType type);

// Returns the word at index `word` as a number. Throws Error naming `field` and line if the word is
// not a number that `type` can represent.
double number_of(const TextLine& line, std::size_t word, const std::string& field, ScalarType type);

// Calls body(row, value) for each row in order; `value` is a double.
template <typename Body>
void for_each_value(const Column& column, std::size_t rows, const Body& body);
// Calls body(row, value) for each row on all threads, in any order.
template <typename Body>
void for_each_value_in_parallel(const Column& column, std::size_t rows, const Body& body);

// Appends rows begin..end-1 to `out` as packed records, each column converted to Column::type;
// `swap_bytes`: in the opposite of this machine's byte order.
void append_records(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                    bool swap_bytes, std::string& out);
std::size_t record_size(const std::vector<Column>& columns);  // bytes per packed record
// Appends rows begin..end-1 to `out` as lines of the shortest numbers that are read back exactly.
void append_rows_of_text(const std::vector<Column>& columns, std::size_t begin, std::size_t end,
                         char separator, std::string& out);
// Writes all rows in blocks. append(begin, end, text) appends rows begin..end-1 to `text`.
void write_rows(
    std::size_t rows, std::ostream& out,
    const std::function<void(std::size_t begin, std::size_t end, std::string& text)>& append);

// Returns the pose cloud_from_sensor as tx ty tz (m) qw qx qy qz, the order of PCD files.
std::array<double, 7> viewpoint_numbers(const Pose& viewpoint);
std::string viewpoint_words(const Pose& viewpoint);  // these numbers as text, each after a space
// Inverse of viewpoint_numbers; nullopt if the quaternion is zero.
std::optional<Pose> pose_of_viewpoint(const std::array<double, 7>& numbers);

inline constexpr std::size_t rows_per_chunk = 16384;  // rows per parallel chunk

// Calls body(row, value) for each row in order; the numbers are stored as T.
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

// Calls use(T{}) with the C++ type T of `type`.
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
  parallel_for(rows, rows_per_chunk, [&](std::size_t begin, std::size_t end) {
    Column part = column;
    part.first += begin * part.stride;
    for_each_value(part, end - begin,
                   [&](std::size_t row, double value) { body(begin + row, value); });
  });
}

// Layout of the points in a binary file, for reading them in blocks.
struct BinaryRecords {
  std::uint64_t begin = 0;            // offset of the first record in the file
  std::size_t bytes = 0;              // size of a record
  std::uint64_t count = 0;            // number of records
  std::vector<Column> columns;        // refer to a block of records that the caller owns
  Pose viewpoint = Pose::Identity();  // cloud_from_sensor
};

}  // namespace libmap
