// In-memory codec of PLY (Turk 1994), ascii and binary little- and big-endian, for clouds and
// meshes. All scalar properties of `vertex` and `face` are kept, with types. The faces are the list
// `vertex_indices` or `vertex_index`; GeometryFileInfo::skipped names other lists and elements.
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

// Reads the header only; `head` is the beginning of the file with the whole header, `file_bytes`
// the size of the file. Throws as decode_ply does.
GeometryFileInfo ply_info(std::string_view head, std::uint64_t file_bytes);

// Returns the layout of the vertices in a binary file, with columns that refer to records at the
// address `block`; nullopt if the file is ascii, or if the vertices or an element before the
// vertices contain a list. Throws Error as decode_ply does.
std::optional<BinaryRecords> ply_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block);

// Decodes a file. Throws Error (without the file's name) for an invalid header line, truncated data
// (checked before memory is allocated), a face with fewer than 3 corners or an index out of range.
GeometryColumns decode_ply(const std::shared_ptr<const std::string>& bytes);

// Writes a file; the viewpoint is a comment line. Throws Error for a field name that is not valid
// in a header, or more than 2^31 - 1 vertices of a mesh.
void encode_ply(const GeometryContent& content, const GeometryWriteOptions& options,
                std::ostream& out);

}  // namespace libmap
