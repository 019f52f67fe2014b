// The header of a PLY file (Turk 1994).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/cloud/columns.h"

namespace libmap {

struct PlyProperty {
  std::string name;
  StoredType type = StoredType::float32;
  bool is_list = false;
  StoredType count_type = StoredType::uint8;  // of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  bool has_lists() const;  // whether a row's length depends on its content
  // Bytes of a row in a binary file, the least if it has lists.
  std::size_t record_bytes() const;
};

struct PlyHeader {
  FileEncoding encoding = FileEncoding::ascii;
  bool big_endian = false;
  std::vector<PlyElement> elements;
  std::optional<Pose>
      viewpoint;  // "comment viewpoint tx ty tz qw qx qy qz", as this project writes
  std::size_t data_begin = 0;
  std::size_t data_line = 1;

  const PlyElement* find(std::string_view name) const;  // the element of that name, or nullptr
};

// Throws Error (without the file's name) naming the line.
PlyHeader read_ply_header(std::string_view text);

// "char", "uchar", ... "double".
std::string ply_type_name(ScalarType type);

}  // namespace libmap
