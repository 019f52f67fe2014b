// PLY (Turk 1994): ascii, binary little- and big-endian, in memory, for clouds and meshes alike.
// All scalar properties of `vertex` and `face` are kept with their types; `vertex_indices` (or
// `vertex_index`) makes the faces; other lists and other elements are passed over and named in
// info.skipped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/io/columns.h"

namespace libmap {

// The header alone; `file_bytes` is the size of the whole file. Throws Error as decode_ply does.
GeometryFileInfo ply_info(std::string_view head, std::uint64_t file_bytes);

// The vertices of a binary file without lists in or before them, with columns on records that begin
// at `block`; nothing for any other file. Throws Error as decode_ply does.
std::optional<BinaryRecords> ply_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block);

// Throws Error (without the file's name): a header line that cannot be understood, more rows
// promised than there is data (known before memory for them is taken), a face with less than three
// corners or with a corner that is no vertex.
GeometryColumns decode_ply(const std::shared_ptr<const std::string>& bytes);

// The viewpoint is a comment line. Throws Error: a field name that cannot stand in the header.
void encode_ply(const GeometryContent& content, const GeometryWriteOptions& options,
                std::ostream& out);

}  // namespace libmap
