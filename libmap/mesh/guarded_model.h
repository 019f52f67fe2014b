// Models read by assimp, which falls over some broken files, in a process of its own.
#pragma once

#include <cstdint>
#include <functional>

#include "libmap/mesh/assimp_codec.h"

namespace libmap {

// What decode() returns or throws there. Throws Error if it fell, or took more memory than a file
// of so many bytes can need.
DecodedModel decode_guarded(std::uint64_t file_bytes, const std::function<DecodedModel()>& decode);

}  // namespace libmap
