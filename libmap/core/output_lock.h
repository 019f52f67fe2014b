// Low-level functions for output files: locks, synchronization to disk, errors of system calls.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

// Returns the Error (failed) "PATH: WHAT: system message". `code` is an errno; 0: no message.
Error system_failure(const std::filesystem::path& path, const std::string& what, int code);

// Waits until a file or folder is stored on disk (fsync). Throws Error (failed) naming `path`.
void sync_file(const std::filesystem::path& path);

// Returns the parent folder; "." if the path has none.
std::filesystem::path folder_of(const std::filesystem::path& path);

// Exclusive lock on a file, which one object of one process holds at a time. A missing file is
// created; it is not removed. Throws Error (failed) if the file cannot be created or locked.
class FileLock {
 public:
  // Waits until the lock is free.
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(FileLock&&) noexcept;
  FileLock& operator=(FileLock&&) noexcept;
  // Does not wait. Returns nullopt if another object or process holds the lock.
  static std::optional<FileLock> try_lock(const std::filesystem::path& path);

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace libmap
