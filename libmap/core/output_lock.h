// Locks on files, syncs, and the errors of system calls.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

// "WHAT: the system's message", kind failed. `code` is an errno; 0: no message.
Error system_failure(const std::filesystem::path& path, const std::string& what, int code);

// Has what was written to a file or folder put on the disk. Throws Error (failed) naming `path`.
void sync_file(const std::filesystem::path& path);

// "." where the path has no folder.
std::filesystem::path folder_of(const std::filesystem::path& path);

// Held by at most one process or object at a time. The file of that name is made if it is missing,
// and is left there. Throws Error (failed): it cannot be made.
class FileLock {
 public:
  // Waits until nobody else holds it.
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(FileLock&&) noexcept;
  FileLock& operator=(FileLock&&) noexcept;
  // Nothing if somebody else holds it.
  static std::optional<FileLock> try_lock(const std::filesystem::path& path);

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace libmap
