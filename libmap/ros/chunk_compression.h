// Compressed chunks of MCAP (https://mcap.dev/spec/registry#well-known-compression-formats): frames
// of LZ4 and Zstandard, by their libraries. Inner part of the MCAP reader and writer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace libmap {

// `size` is what they are said to expand to. Memory grows with what they do expand to. Throws
// Error: another compression ("": none), broken, another size, more than 1 GiB.
std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size);
std::string compress_chunk(const std::string& compression, const std::string& bytes);

}  // namespace libmap
