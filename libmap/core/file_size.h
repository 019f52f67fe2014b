// How large a file may be that is read as a whole.
#pragma once

#include <cstdint>
#include <filesystem>

namespace libmap {

// Bytes of memory: to read a larger file whole would end the program, not the reading.
std::uint64_t machine_memory();

// Throws Error if the file `path` is larger than `max_bytes`, or not there.
void require_file_size(const std::filesystem::path& path, std::uint64_t max_bytes);

}  // namespace libmap
