// Description of a cloud or mesh file in any format: encoding, sizes, fields.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Encoding of the numbers in a file; PLY supports only ascii and binary.
enum class FileEncoding { ascii, binary, binary_compressed };

struct GeometryWriteOptions {
  FileEncoding encoding =
      FileEncoding::binary;  // PLY: binary_compressed means binary; no effect on OBJ, OFF, CSV, GLB
  bool big_endian = false;   // byte order of a binary PLY; no effect on other files
};

struct FileField {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::size_t count = 1;  // numbers per point; 0 for a list of variable length

  bool operator==(const FileField&) const = default;
};

struct GeometryFileInfo {
  std::string format;  // "pcd", "ply", "csv", "tif", "obj", "stl", "off", "glb"
  FileEncoding encoding = FileEncoding::binary;
  bool big_endian = false;           // byte order of binary numbers
  std::uint64_t bytes = 0;           // size of the file
  std::uint64_t points = 0;          // points or vertices of the file, also dropped points
  std::uint64_t faces = 0;           // number of polygons
  std::vector<FileField> fields;     // point fields, with names and order of the file
  std::vector<std::string> skipped;  // content of the file that the reader ignores
};

std::string to_text(FileEncoding encoding);  // "ascii", "binary", "binary_compressed"
std::string to_text(ScalarType type);        // "int8", ... "float64"

}  // namespace libmap
