// What VTK does not check before it trusts a VTP file: without it, wrong counts, types and block
// headers end the program.
#pragma once

#include <string_view>

namespace libmap {

// Throws Error (without the file's name) if the XML part names a count, type or format that the
// file cannot hold, or a block of data claims more bytes than there are.
void require_sane_vtp(std::string_view bytes);

}  // namespace libmap
