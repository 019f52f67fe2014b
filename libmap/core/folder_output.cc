#include "libmap/core/folder_output.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/output_lock.h"
#include "libmap/core/unfinished_outputs.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

void require_own_content(const fs::path& path, const std::vector<std::string>& names) {
  const fs::file_status status = fs::symlink_status(path);
  if (!fs::exists(status)) return;
  if (!fs::is_directory(status)) throw Error("is not a folder", {.file = path.string()});
  for (const fs::directory_entry& entry : fs::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw Error(
          "would be replaced as a whole, but contains " + name + ", which is not of its kind",
          {.file = path.string()});
  }
}

// The lock is on the folder itself, which commit() takes away from its name.
int open_folder(const char* path) {
  if (mkdir(path, 0777) != 0 && errno != EEXIST) return -1;
  return open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

// Whether an earlier folder took the temporary's name.
bool put_in_place(const fs::path& temporary, const fs::path& final_path) {
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, final_path.c_str(), RENAME_EXCHANGE) == 0)
    return true;
  const int exchange_code = errno;
  if (exchange_code != ENOENT && exchange_code != EINVAL && exchange_code != ENOSYS)
    throw system_failure(final_path, "cannot be put in place", exchange_code);
  // Nothing is there, or the temporary is gone, and the earlier folder stays; or the file system
  // cannot exchange.
  std::error_code code;
  if (exchange_code != ENOENT) fs::remove_all(final_path, code);
  if (!code) fs::rename(temporary, final_path, code);
  if (code) throw system_failure(final_path, "cannot be put in place", code.value());
  return false;
}

}  // namespace

OutputFolder::OutputFolder(fs::path final_path, const std::vector<std::string>& names)
    : final_path_(std::move(final_path)) {
  if (!final_path_.has_filename()) final_path_ = final_path_.parent_path();
  if (final_path_.filename() == "." || final_path_.filename() == "..")
    throw Error("the output folder needs a name of its own", {.file = final_path_.string()});
  const fs::path folder = folder_of(final_path_);
  if (!fs::is_directory(folder))
    throw Error("no such folder: " + folder.string(), {.file = final_path_.string()});
  require_own_content(final_path_, names);
  temporary_path_ = folder / ("." + final_path_.filename().string() + ".partial");
  const OutputsInStep step;
  lock_ = lock_temporary(temporary_path_, final_path_, open_folder);
  add_unfinished_output(temporary_path_);
  // What a run that was killed has left.
  for (const fs::directory_entry& entry : fs::directory_iterator(temporary_path_))
    fs::remove_all(entry.path());
}

OutputFolder::~OutputFolder() {
  if (lock_ < 0) return;
  const OutputsInStep step;
  std::error_code ignored;
  fs::remove_all(temporary_path_, ignored);
  drop_unfinished_output(temporary_path_);
  close(lock_);
}

void OutputFolder::commit() {
  // All files at once: one by one it takes a write to the disk each.
  if (syncfs(lock_) != 0) throw system_failure(final_path_, "cannot be synced", errno);
  const OutputsInStep step;
  // The earlier folder is locked too, so that nobody takes it for a temporary of his own.
  const int earlier = open(final_path_.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (earlier >= 0) flock(earlier, LOCK_EX | LOCK_NB);
  const bool exchanged = put_in_place(temporary_path_, final_path_);
  std::error_code ignored;
  if (exchanged) fs::remove_all(temporary_path_, ignored);
  drop_unfinished_output(temporary_path_);
  if (earlier >= 0) close(earlier);
  close(std::exchange(lock_, -1));
  const int parent = open(folder_of(final_path_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (parent < 0) return;
  fsync(parent);
  close(parent);
}

}  // namespace libmap
