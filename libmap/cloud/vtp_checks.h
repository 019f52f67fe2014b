// What VTK does not check before it trusts a VTP file: without it, wrong counts, types and block
// headers end the program.
#pragma once

#include <cstdint>
#include <string_view>

namespace libmap {

// Throws Error (without the file's name) if the XML part names a count, type or format that the
// file cannot hold, a block of data claims more bytes than there are, an array of texts holds
// another number of them than its data, two arrays have one name, or one is not in every piece.
// Returns how many points the pieces promise.
std::uint64_t require_sane_vtp(std::string_view bytes);

}  // namespace libmap
