// Files in and out: whole files in, outputs that appear whole or not at all, temporary files.
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

// Throws Error with one clear reason unless `path` is a file that can be read.
void require_readable_file(const std::filesystem::path& path);

// Throws Error if the file `path` is larger than `max_bytes`, or missing.
void require_file_size(const std::filesystem::path& path, std::uint64_t max_bytes);

// Throws Error: no such file, a folder, not readable, or larger than `max_bytes`.
std::string read_whole_file(const std::filesystem::path& path,
                            std::uint64_t max_bytes = std::uint64_t{1} << 30);

// The first bytes of a file, at most `max_bytes`; none if it cannot be read.
std::string file_head(const std::filesystem::path& path, std::size_t max_bytes);

// `content` straight to `path`, for callers that hold an OutputFile. Throws Error (failed).
void write_text(const std::filesystem::path& path, std::string_view content);

// `content` as a whole file, through an OutputFile.
void write_whole_file(const std::filesystem::path& path, std::string_view content);

// An uncommitted output in the folder of the final one, under a temporary name. Without a commit
// the temporary is removed and an earlier output stays as it was. While it exists, a second process
// that wants to write the same output gets an Error.
class PendingOutput {
 public:
  ~PendingOutput();
  PendingOutput(PendingOutput&&) noexcept;
  PendingOutput& operator=(PendingOutput&&) = delete;

  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  const std::filesystem::path& final_path() const { return final_path_; }

 protected:
  // `open_temporary` makes and opens the temporary; it returns a descriptor, or -1 with errno.
  PendingOutput(std::filesystem::path final_path, const std::string& temporary_name,
                int (*open_temporary)(const char* path));
  // From now on the temporary's name is free again.
  void release();
  int lock() const { return lock_; }

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  int lock_ = -1;
};

// One output file. Write to temporary_path(), which has the extension of the final one.
class OutputFile : public PendingOutput {
 public:
  // Throws Error if the folder does not exist or cannot be written to, or the path is a folder or
  // anything else that is no regular file.
  explicit OutputFile(const std::filesystem::path& final_path);
  // Syncs it and renames it onto the final path. Throws Error (failed).
  void commit();
};

// One output folder. Write into temporary_path().
class OutputFolder : public PendingOutput {
 public:
  // `names` are those that the folder may contain: an earlier one that contains any other is not
  // replaced. Throws Error: the path is not a folder, or one with foreign content, or it cannot be
  // written.
  OutputFolder(const std::filesystem::path& final_path, const std::vector<std::string>& names);
  // Syncs it and puts it in place of the final one, whose earlier content is then gone. Throws
  // Error (failed).
  void commit();
};

// Syncs all `outputs`, then puts them in place in their order. abandon_unfinished_outputs() takes
// effect before or after all of it. Throws Error (failed) as OutputFile::commit() does.
void commit_together(std::vector<OutputFile>& outputs);

// While one exists, abandon_unfinished_outputs() waits: for outputs that belong together and are
// put in place one after the other.
class CommitGuard {
 public:
  CommitGuard();

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

// Removes the temporary files and folders of all uncommitted outputs of this process. Threads that
// make, commit or drop an output wait from then on and for ever: call it right before the process
// ends.
void abandon_unfinished_outputs();

// Whether a file or folder bears the name of an uncommitted one. A run that was killed leaves such.
bool is_named_unfinished(const std::filesystem::path& path);

// The same error for another file.
Error naming(const Error& error, const std::filesystem::path& file);

// Calls `write` with `temporary`. An Error of it that names that file, or one in that folder, names
// `output`, or the one in it, instead.
void write_named(const std::filesystem::path& temporary, const std::filesystem::path& output,
                 const std::function<void(const std::filesystem::path&)>& write);

// Bytes on disk in a file without a name: nothing is left of it, however the process ends.
class TempFile {
 public:
  // Throws Error (failed): no file can be made in the folder.
  explicit TempFile(std::filesystem::path folder);
  ~TempFile();
  TempFile(const TempFile&) = delete;
  TempFile& operator=(const TempFile&) = delete;

  // Returns the position of the appended bytes. Both may be called from several threads, and throw
  // Error (failed).
  std::uint64_t append(const void* bytes, std::size_t count);
  void read(std::uint64_t begin, void* bytes, std::size_t count) const;

 private:
  std::filesystem::path folder_;
  int file_ = -1;
  std::mutex mutex_;
  std::uint64_t end_ = 0;
};

}  // namespace libmap
