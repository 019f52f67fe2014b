// Reads whole files and writes outputs atomically through temporary files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/error.h"

namespace libmap {

// Throws Error unless `path` is a readable regular file.
void require_readable_file(const std::filesystem::path& path);

// Throws Error if the file `path` is missing or larger than `max_bytes`.
void require_file_size(const std::filesystem::path& path, std::uint64_t max_bytes);

// Returns the file's content. Throws Error unless it is readable and at most `max_bytes` long.
std::string read_whole_file(const std::filesystem::path& path,
                            std::uint64_t max_bytes = std::uint64_t{1} << 30);

// Returns the first bytes of a file, at most `max_bytes`; empty if it cannot be read.
std::string file_head(const std::filesystem::path& path, std::size_t max_bytes);

// Writes `content` directly to `path`, e.g. OutputFile::temporary_path(). Throws Error (failed).
void write_text(const std::filesystem::path& path, std::string_view content);

// Writes `content` atomically through an OutputFile. Throws as OutputFile and commit() do.
void write_whole_file(const std::filesystem::path& path, std::string_view content);

// An output before its commit: a temporary file or folder next to the final path. Without commit(),
// the destructor removes it, and an earlier output is unchanged. While this object exists, the
// constructor of a second object for the same path, in any process, throws Error (failed).
class PendingOutput {
 public:
  ~PendingOutput();
  PendingOutput(PendingOutput&&) noexcept;
  PendingOutput& operator=(PendingOutput&&) = delete;

  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  const std::filesystem::path& final_path() const { return final_path_; }

 protected:
  // `open_temporary` creates and opens the file or folder. It returns a descriptor; -1: see errno.
  PendingOutput(std::filesystem::path final_path, const std::string& temporary_name,
                int (*open_temporary)(const char* path));
  // Unlocks the file or folder and removes its path from the list of uncommitted outputs.
  void release();
  int lock() const { return lock_; }  // descriptor of the temporary file or folder

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  int lock_ = -1;
};

// An output file. Write to temporary_path(), which has the final path's extension, then commit().
class OutputFile : public PendingOutput {
 public:
  // Throws Error if the folder does not exist or is not writable, or if the path exists and is not
  // a regular file.
  explicit OutputFile(const std::filesystem::path& final_path);
  // Syncs the temporary file to disk and renames it to the final path. Throws Error (failed).
  void commit();
};

// An output folder. Write into temporary_path(), then call commit().
class OutputFolder : public PendingOutput {
 public:
  // `names` lists the entries that an earlier folder at `final_path` may contain. Throws Error if
  // there is any other entry, if the path is not a folder, or if it cannot be written.
  OutputFolder(const std::filesystem::path& final_path, const std::vector<std::string>& names);
  // Syncs the temporary folder to disk; it replaces an earlier folder. Throws Error (failed).
  void commit();
};

// Syncs all `outputs`, then commits them in order; abandon_unfinished_outputs() cannot run between
// the commits. Throws Error (failed) as OutputFile::commit() does.
void commit_together(std::vector<OutputFile>& outputs);

// Delays abandon_unfinished_outputs() while the guard exists, e.g. to commit several outputs.
class CommitGuard {
 public:
  CommitGuard();

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

// Removes the temporary files and folders of all uncommitted outputs of this process. Call it right
// before the process exits: threads that create, commit or destroy an output then block forever.
void abandon_unfinished_outputs();

// True if the file name is that of a temporary file or folder, which a killed run does not remove.
bool is_named_unfinished(const std::filesystem::path& path);

// Returns a copy of the error that names `file` instead of the present file.
Error naming(const Error& error, const std::filesystem::path& file);

// Calls write(temporary). If `write` throws an Error that names `temporary` or a file in that
// folder, the path `temporary` in the Error is replaced by `output`.
void write_named(const std::filesystem::path& temporary, const std::filesystem::path& output,
                 const std::function<void(const std::filesystem::path&)>& write);

// An unnamed temporary file. The system removes it when the process ends, also after a crash.
class TempFile {
 public:
  // Throws Error (failed) if no file can be created in the folder.
  explicit TempFile(std::filesystem::path folder);
  ~TempFile();
  TempFile(const TempFile&) = delete;
  TempFile& operator=(const TempFile&) = delete;

  // Appends `count` bytes and returns their offset in the file. Thread-safe. Throws Error (failed).
  std::uint64_t append(const void* bytes, std::size_t count);
  // Reads `count` bytes from the offset `begin`. Thread-safe. Throws Error (failed).
  void read(std::uint64_t begin, void* bytes, std::size_t count) const;

 private:
  std::filesystem::path folder_;
  int file_ = -1;
  std::mutex mutex_;
  std::uint64_t size_ = 0;
};

}  // namespace libmap
