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

// Throws Error if the file `path` is larger than `max_bytes`, or missing.
void require_file_size(const std::filesystem::path& path, std::uint64_t max_bytes);

// Returns the file's content. Throws Error unless it is readable and at most `max_bytes` long.
std::string read_whole_file(const std::filesystem::path& path,
                            std::uint64_t max_bytes = std::uint64_t{1} << 30);

// Returns the first bytes of a file, at most `max_bytes`; empty if it cannot be read.
std::string file_head(const std::filesystem::path& path, std::size_t max_bytes);

// Writes `content` to `path`, not atomically: for temporary_path() below. Throws Error (failed).
void write_text(const std::filesystem::path& path, std::string_view content);

// Writes `content` atomically through an OutputFile, and throws as it does.
void write_whole_file(const std::filesystem::path& path, std::string_view content);

// An uncommitted output, stored under a temporary name in the folder of the final output. Without a
// commit, the destructor removes the temporary, and an earlier output is unchanged. While this
// object exists, a second one for the same output, in any process, throws Error (failed).
class PendingOutput {
 public:
  ~PendingOutput();
  PendingOutput(PendingOutput&&) noexcept;
  PendingOutput& operator=(PendingOutput&&) = delete;

  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  const std::filesystem::path& final_path() const { return final_path_; }

 protected:
  // `open_temporary` creates and opens the temporary. It returns a descriptor, or -1 with errno.
  PendingOutput(std::filesystem::path final_path, const std::string& temporary_name,
                int (*open_temporary)(const char* path));
  // Unlocks the temporary and removes its path from the list of uncommitted outputs.
  void release();
  int lock() const { return lock_; }  // descriptor of the temporary

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  int lock_ = -1;
};

// An output file. Write to temporary_path(), which has the extension of the final path.
class OutputFile : public PendingOutput {
 public:
  // Throws Error if the folder does not exist or is not writable, or if the path exists and is not
  // a regular file.
  explicit OutputFile(const std::filesystem::path& final_path);
  // Syncs the temporary and renames it to the final path. Throws Error (failed).
  void commit();
};

// An output folder. Write into temporary_path().
class OutputFolder : public PendingOutput {
 public:
  // `names` lists the entries that an earlier folder may contain. Throws Error if it contains any
  // other entry, is not a folder or cannot be written.
  OutputFolder(const std::filesystem::path& final_path, const std::vector<std::string>& names);
  // Syncs the temporary and replaces the complete final folder. Throws Error (failed).
  void commit();
};

// Syncs all `outputs`, then commits them in order; abandon_unfinished_outputs() cannot run between
// the commits. Throws Error (failed) as OutputFile::commit() does.
void commit_together(std::vector<OutputFile>& outputs);

// Delays abandon_unfinished_outputs() while it exists: related outputs are committed together.
class CommitGuard {
 public:
  CommitGuard();

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

// Removes the temporary files and folders of all uncommitted outputs of this process. Afterwards,
// threads that create, commit or drop an output block forever: call it right before the process
// exits.
void abandon_unfinished_outputs();

// True for the temporary path of an uncommitted file or folder, which a killed run leaves behind.
bool is_named_unfinished(const std::filesystem::path& path);

// Returns a copy of the error that names `file` instead of the present file.
Error naming(const Error& error, const std::filesystem::path& file);

// Calls `write` with `temporary`. In Errors that name `temporary`, or a file in it, replaces the
// temporary path by `output`.
void write_named(const std::filesystem::path& temporary, const std::filesystem::path& output,
                 const std::function<void(const std::filesystem::path&)>& write);

// An unnamed temporary file. The system removes it however the process ends.
class TempFile {
 public:
  // Throws Error (failed) if no file can be created in the folder.
  explicit TempFile(std::filesystem::path folder);
  ~TempFile();
  TempFile(const TempFile&) = delete;
  TempFile& operator=(const TempFile&) = delete;

  // Appends bytes and returns their offset; reads bytes at an offset. Both functions are
  // thread-safe and throw Error (failed).
  std::uint64_t append(const void* bytes, std::size_t count);
  void read(std::uint64_t begin, void* bytes, std::size_t count) const;

 private:
  std::filesystem::path folder_;
  int file_ = -1;
  std::mutex mutex_;
  std::uint64_t size_ = 0;
};

}  // namespace libmap
