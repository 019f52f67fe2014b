// Outputs in the making, by the names that the user knows.
#pragma once

#include <filesystem>
#include <functional>

#include "libmap/core/error.h"

namespace libmap {

// The same error of another file.
Error naming(const Error& error, const std::filesystem::path& file);

// Calls `write` with `temporary`. An Error of it that names that file, or one in that folder, names
// `output`, or the one in it, instead.
void write_named(const std::filesystem::path& temporary, const std::filesystem::path& output,
                 const std::function<void(const std::filesystem::path&)>& write);

}  // namespace libmap
