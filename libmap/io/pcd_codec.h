// PCD, the Point Cloud Library's format, versions 0.5 to 0.7: ascii, binary and binary_compressed
// (LZF), in memory. Values are little-endian. Files name them by the rule of cloud_columns.h, with
// packed `rgb` or `rgba` (one 4-byte number, U or F) as red, green, blue; the alpha byte is passed
// over. A field of COUNT n > 1 becomes n columns NAME_0 .. NAME_n-1; fields named `_` are padding.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>

#include "libmap/io/columns.h"

namespace libmap {

// The header alone; `file_bytes` is the size of the whole file. Throws Error as decode_pcd does.
GeometryFileInfo pcd_info(std::string_view head, std::uint64_t file_bytes);

// The records of a binary file, with columns on records that begin at `block`; nothing if the file
// has another encoding. Throws Error as decode_pcd does.
std::optional<BinaryRecords> pcd_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block);

// Throws Error (without the file's name): a header line that is missing, unknown, is a duplicate or
// does not fit the others; more points promised than there is data; compressed data that is broken.
// All of this is known before memory for the points is taken. `owner` keeps the bytes.
GeometryColumns decode_pcd(std::string_view bytes, const std::shared_ptr<const void>& owner);

// Colors are written as packed `rgb`, TYPE U. Throws Error: a field name that cannot stand in the
// header, or more than 4 GiB to compress. encode_pcd: both, the header of these points alone.
std::string pcd_header(const ColumnSet& columns, std::uint64_t points, const Pose& viewpoint,
                       FileEncoding encoding);
void encode_pcd_points(const ColumnSet& columns, FileEncoding encoding, std::ostream& out);
void encode_pcd(const ColumnSet& columns, const Pose& viewpoint, FileEncoding encoding,
                std::ostream& out);

}  // namespace libmap
