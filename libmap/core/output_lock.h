// What output files and output folders share: the lock on what is in the making. Inner part of
// libmap/core.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

// "WHAT: the system's message", kind failed. `code` is an errno.
Error system_failure(const std::filesystem::path& path, const std::string& what, int code);

// "." where the path has no folder.
std::filesystem::path folder_of(const std::filesystem::path& path);

// Opens `temporary` with `open_temporary`, which returns a descriptor or -1 with errno, and locks
// it; again where another process has put it in place meanwhile. Throws Error naming `final_path`:
// it cannot be opened, or another process holds it.
int lock_temporary(const std::filesystem::path& temporary, const std::filesystem::path& final_path,
                   const std::function<int(const char* path)>& open_temporary);

}  // namespace libmap
