// In-memory codec of PCD, the Point Cloud Library's format, versions 0.5 to 0.7: ascii, binary and
// binary_compressed (LZF). Values are little-endian. Column names are defined in cloud_columns.h.
// Packed `rgb` or `rgba` (one 4-byte number, U or F) is read as red, green, blue without alpha. A
// field of COUNT n > 1 becomes n columns NAME_0 .. NAME_n-1; fields named `_` are padding.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>

#include "libmap/io/columns.h"

namespace libmap {

// Reads the header only; `head` is the beginning of the file with the whole header, `file_bytes`
// the size of the file. Throws as decode_pcd does.
GeometryFileInfo pcd_info(std::string_view head, std::uint64_t file_bytes);

// Returns the layout of the points in a binary file, with columns that refer to records at the
// address `block`; nullopt if the file has another encoding. Throws Error as decode_pcd does.
std::optional<BinaryRecords> pcd_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block);

// Decodes a file; the columns refer to `bytes`, which `owner` owns. Throws Error (without the
// file's name) for a missing, unknown, duplicate or inconsistent header line, truncated data and
// invalid compressed data. The sizes are checked before memory is allocated.
GeometryColumns decode_pcd(std::string_view bytes, const std::shared_ptr<const void>& owner);

// Returns the header of a file with `points` points. Colors are a packed field `rgb`, TYPE U.
// Throws Error for a field name that is not valid in a header.
std::string pcd_header(const ColumnSet& columns, std::uint64_t points, const Pose& viewpoint,
                       FileEncoding encoding);
// Writes the points after the header. Throws Error for more than 2.8 GB to compress.
void encode_pcd_points(const ColumnSet& columns, FileEncoding encoding, std::ostream& out);
void encode_pcd(const ColumnSet& columns, const Pose& viewpoint, FileEncoding encoding,
                std::ostream& out);  // writes header and points; throws as both functions

}  // namespace libmap
