// What a cloud or mesh file says of itself, whatever its format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// How the numbers of a file are stored; PLY knows the first two.
enum class FileEncoding { ascii, binary, binary_compressed };

struct GeometryWriteOptions {
  FileEncoding encoding =
      FileEncoding::binary;  // what a format does not have is the nearest it has
  bool big_endian = false;   // PLY, binary
};

struct FileField {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::size_t count = 1;  // numbers a point; 0 for a list whose length differs from point to point

  bool operator==(const FileField&) const = default;
};

struct GeometryFileInfo {
  std::string format;  // "pcd", "ply", "csv", "obj", "stl", "off", "glb"
  FileEncoding encoding = FileEncoding::binary;
  bool big_endian = false;
  std::uint64_t bytes = 0;           // size of the file
  std::uint64_t points = 0;          // as the file holds them, before any is dropped
  std::uint64_t faces = 0;           // polygons
  std::vector<FileField> fields;     // of the points, in the file's order and under its names
  std::vector<std::string> skipped;  // what the file holds and the reader passes over
};

std::string to_text(FileEncoding encoding);  // "ascii", "binary", "binary_compressed"
std::string to_text(ScalarType type);        // "int8", ... "float64"

}  // namespace libmap
