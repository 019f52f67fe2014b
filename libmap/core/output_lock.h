// Low-level file functions of outputs: locks, synchronization to disk, errors of system calls.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

// Returns the error "WHAT: system message" of kind failed. `code` is an errno; 0: no message.
Error system_failure(const std::filesystem::path& path, const std::string& what, int code);

// Writes a file or folder to disk (fsync). Throws Error (failed) naming `path`.
void sync_file(const std::filesystem::path& path);

// Returns the parent folder; "." if the path has none.
std::filesystem::path folder_of(const std::filesystem::path& path);

// Exclusive lock of one process or object on a file. A missing file is created; it is not removed.
// Throws Error (failed) if the file cannot be created.
class FileLock {
 public:
  // Waits until the lock is free.
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(FileLock&&) noexcept;
  FileLock& operator=(FileLock&&) noexcept;
  // Returns nullopt if the lock is taken.
  static std::optional<FileLock> try_lock(const std::filesystem::path& path);

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace libmap
