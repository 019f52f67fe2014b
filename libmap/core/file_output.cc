#include "libmap/core/file_output.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "libmap/core/output_lock.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// State of the whole process, because a signal ends the whole process. It is never destroyed:
// threads can outlive main.
struct Unfinished {
  std::recursive_mutex mutex;
  std::set<fs::path> temporaries;
};

Unfinished& unfinished() {
  static auto* const all = new Unfinished;
  return *all;
}

// Renames a folder before its removal, because other threads can still create files by its old
// name. Only files that they are opening at that moment remain.
void remove_whole(const fs::path& path) {
  constexpr int tries = 100;
  std::error_code code;
  fs::path doomed = path;
  if (fs::is_directory(fs::symlink_status(path, code))) {
    doomed += ".gone";
    fs::rename(path, doomed, code);
    if (code) doomed = path;
  }
  for (int n = 0; n < tries; ++n) {
    fs::remove_all(doomed, code);
    if (!code) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

bool is_still_named(int descriptor, const fs::path& path) {
  struct stat held {};
  struct stat named {};
  return fstat(descriptor, &held) == 0 && stat(path.c_str(), &named) == 0 &&
         held.st_dev == named.st_dev && held.st_ino == named.st_ino;
}

// Opens `temporary` with `open_temporary`, which returns a descriptor or -1 with errno, and locks
// it. Repeats this if another process has committed the temporary in between. Throws Error naming
// `final_path` if it cannot be opened or another process has locked it.
int lock_temporary(const fs::path& temporary, const fs::path& final_path,
                   int (*open_temporary)(const char*)) {
  for (;;) {
    const int lock = open_temporary(temporary.c_str());
    if (lock < 0 && errno == ENOENT && fs::is_directory(folder_of(temporary))) continue;
    if (lock < 0) throw system_failure(final_path, "cannot be written", errno);
    // NFS cannot lock a folder that is open for reading (EBADF): it stays unlocked.
    if (flock(lock, LOCK_EX | LOCK_NB) != 0 && errno != EBADF) {
      const int code = errno;
      close(lock);
      if (code != EWOULDBLOCK) throw system_failure(final_path, "cannot be locked", code);
      throw Error("another process is writing this output", {.file = final_path.string()},
                  ErrorKind::failed);
    }
    // Between opening and locking, another process can have committed this file.
    if (is_still_named(lock, temporary)) return lock;
    close(lock);
  }
}

void require_folder_of(const fs::path& final_path) {
  const fs::path folder = folder_of(final_path);
  if (!fs::is_directory(folder))
    throw Error("no such folder: " + folder.string(), {.file = final_path.string()});
}

const fs::path& checked_file(const fs::path& final_path) {
  if (final_path.filename().empty() || fs::is_directory(final_path))
    throw Error("is a folder, not a file", {.file = final_path.string()});
  // A commit would replace a device or a pipe by a regular file.
  if (fs::exists(final_path) && !fs::is_regular_file(final_path))
    throw Error("is not a regular file", {.file = final_path.string()});
  require_folder_of(final_path);
  return final_path;
}

// The extension stays at the end: writers choose the format by it.
std::string temporary_name_of(const fs::path& final_path) {
  return "." + final_path.stem().string() + ".partial" + final_path.extension().string();
}

int open_file(const char* path) {
  return open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
}

void require_own_content(const fs::path& path, const std::vector<std::string>& names) {
  const fs::file_status status = fs::symlink_status(path);
  if (!fs::exists(status)) return;
  if (!fs::is_directory(status)) throw Error("is not a folder", {.file = path.string()});
  for (const fs::directory_entry& entry : fs::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw Error("contains " + name + ", which this command does not write; use another folder",
                  {.file = path.string()});
  }
}

fs::path without_slash(const fs::path& path) {
  return path.has_filename() ? path : path.parent_path();
}

fs::path checked_folder(const fs::path& given, const std::vector<std::string>& names) {
  fs::path final_path = without_slash(given);
  if (final_path.filename() == "." || final_path.filename() == "..")
    throw Error("cannot be replaced; give a folder by its name", {.file = final_path.string()});
  require_folder_of(final_path);
  require_own_content(final_path, names);
  return final_path;
}

// The lock is on the folder itself, which commit() renames.
int open_folder(const char* path) {
  if (mkdir(path, 0777) != 0 && errno != EEXIST) return -1;
  return open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

// Renames the temporary to the final path. True if both existed and were exchanged.
bool put_in_place(const fs::path& temporary, const fs::path& final_path) {
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, final_path.c_str(), RENAME_EXCHANGE) == 0)
    return true;
  const int exchange_code = errno;
  if (exchange_code != ENOENT && exchange_code != EINVAL && exchange_code != ENOSYS)
    throw system_failure(final_path, "cannot be replaced", exchange_code);
  // ENOENT: there is no earlier folder, or the temporary is gone and the earlier folder is kept.
  // Otherwise, the file system cannot exchange.
  std::error_code code;
  if (exchange_code != ENOENT) fs::remove_all(final_path, code);
  if (!code) fs::rename(temporary, final_path, code);
  if (code) throw system_failure(final_path, "cannot be replaced", code.value());
  return false;
}

}  // namespace

void require_readable_file(const fs::path& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (status.type() == fs::file_type::not_found)
    throw Error("no such file", {.file = path.string()});
  if (code) throw Error(code.message(), {.file = path.string()});
  if (status.type() == fs::file_type::directory)
    throw Error("is a folder, not a file", {.file = path.string()});
  if (status.type() != fs::file_type::regular)
    throw Error("is not a regular file", {.file = path.string()});
  if (access(path.c_str(), R_OK) != 0)
    throw Error(std::string("cannot be read: ") + std::strerror(errno), {.file = path.string()});
}

std::string file_head(const fs::path& path, std::size_t max_bytes) {
  std::ifstream file(path, std::ios::binary);
  std::string head(max_bytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(max_bytes));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
}

void require_file_size(const fs::path& path, std::uint64_t max_bytes) {
  std::error_code code;
  const std::uint64_t bytes = fs::file_size(path, code);
  if (code) throw Error(code.message(), {.file = path.string()});
  if (bytes > max_bytes)
    throw Error("too large to be read into memory", {.file = path.string(),
                                                     .field = "size",
                                                     .value = std::to_string(bytes) + " bytes",
                                                     .bound = "<= " + std::to_string(max_bytes)});
}

std::string read_whole_file(const fs::path& path, std::uint64_t max_bytes) {
  require_readable_file(path);
  require_file_size(path, max_bytes);
  const std::uint64_t bytes = fs::file_size(path);
  std::string content(bytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(content.data(), static_cast<std::streamsize>(bytes));
  if (!file) throw Error("cannot be read", {.file = path.string()});
  return content;
}

void write_text(const fs::path& path, std::string_view content) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  file.flush();
  if (!file) throw system_failure(path, "cannot be written", errno);
}

void write_whole_file(const fs::path& path, std::string_view content) {
  OutputFile output(path);
  write_named(output.temporary_path(), path,
              [&](const fs::path& temporary) { write_text(temporary, content); });
  output.commit();
}

PendingOutput::PendingOutput(fs::path final_path, const std::string& temporary_name,
                             int (*open_temporary)(const char*))
    : final_path_(std::move(final_path)), temporary_path_(folder_of(final_path_) / temporary_name) {
  const CommitGuard guard;
  lock_ = lock_temporary(temporary_path_, final_path_, open_temporary);
  unfinished().temporaries.insert(temporary_path_);
}

PendingOutput::~PendingOutput() {
  if (lock_ < 0) return;
  const CommitGuard guard;
  std::error_code ignored;
  fs::remove_all(temporary_path_, ignored);
  release();
}

PendingOutput::PendingOutput(PendingOutput&& other) noexcept
    : final_path_(std::move(other.final_path_)),
      temporary_path_(std::move(other.temporary_path_)),
      lock_(std::exchange(other.lock_, -1)) {}

void PendingOutput::release() {
  unfinished().temporaries.erase(temporary_path_);
  close(std::exchange(lock_, -1));
}

OutputFile::OutputFile(const fs::path& final_path)
    : PendingOutput(checked_file(final_path), temporary_name_of(final_path), open_file) {}

void OutputFile::commit() {
  sync_file(temporary_path());
  const CommitGuard guard;
  std::error_code code;
  fs::rename(temporary_path(), final_path(), code);
  if (code) throw system_failure(final_path(), "cannot be replaced", code.value());
  release();
  sync_file(folder_of(final_path()));
}

OutputFolder::OutputFolder(const fs::path& final_path, const std::vector<std::string>& names)
    : PendingOutput(checked_folder(final_path, names),
                    "." + without_slash(final_path).filename().string() + ".partial", open_folder) {
  // Leftovers of a killed run.
  for (const fs::directory_entry& entry : fs::directory_iterator(temporary_path()))
    fs::remove_all(entry.path());
}

void OutputFolder::commit() {
  // Syncs all files at once: one by one, each file costs a disk write.
  if (syncfs(lock()) != 0) throw system_failure(final_path(), "cannot be synced", errno);
  const CommitGuard guard;
  // The earlier folder is locked too, so that no other process uses it as its temporary.
  const int earlier = open(final_path().c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (earlier >= 0) flock(earlier, LOCK_EX | LOCK_NB);
  const bool exchanged = put_in_place(temporary_path(), final_path());
  std::error_code ignored;
  if (exchanged) fs::remove_all(temporary_path(), ignored);
  release();
  if (earlier >= 0) close(earlier);
  const int parent = open(folder_of(final_path()).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (parent < 0) return;
  fsync(parent);
  close(parent);
}

CommitGuard::CommitGuard() : lock_(unfinished().mutex) {}

void commit_together(std::vector<OutputFile>& outputs) {
  for (const OutputFile& output : outputs) sync_file(output.temporary_path());
  const CommitGuard guard;
  for (OutputFile& output : outputs) output.commit();
}

void abandon_unfinished_outputs() {
  unfinished().mutex.lock();
  // Twice, because threads can create files by name in the meantime.
  for (int n = 0; n < 2; ++n)
    for (const fs::path& temporary : unfinished().temporaries) remove_whole(temporary);
}

bool is_named_unfinished(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.starts_with('.') && name.find(".partial") != std::string::npos;
}

Error naming(const Error& error, const fs::path& file) {
  ErrorContext context = error.context();
  context.file = file.string();
  return Error(error.reason(), context, error.kind());
}

void write_named(const fs::path& temporary, const fs::path& output,
                 const std::function<void(const fs::path&)>& write) {
  try {
    write(temporary);
  } catch (const Error& error) {
    const std::string& file = error.context().file;
    const std::string within = temporary.string() + "/";
    if (file == temporary.string()) throw naming(error, output);
    if (file.starts_with(within)) throw naming(error, output / file.substr(within.size()));
    throw;
  }
}

TempFile::TempFile(std::filesystem::path folder) : folder_(std::move(folder)) {
  // An unnamed file ends with the process, but not every file system supports it.
  file_ = open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file_ >= 0) return;
  std::string name = (folder_ / ".unnamed-XXXXXX").string();
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) throw system_failure(folder_, "cannot create a temporary file", errno);
  unlink(name.c_str());
}

TempFile::~TempFile() { close(file_); }

std::uint64_t TempFile::append(const void* bytes, std::size_t count) {
  std::uint64_t begin = 0;
  {
    const std::lock_guard lock(mutex_);
    begin = size_;
    size_ += count;
  }
  std::size_t done = 0;
  while (done < count) {
    const ssize_t written = pwrite(file_, static_cast<const char*>(bytes) + done, count - done,
                                   static_cast<off_t>(begin + done));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw system_failure(folder_, "cannot write a temporary file", errno);
    done += static_cast<std::size_t>(written);
  }
  return begin;
}

void TempFile::read(std::uint64_t begin, void* bytes, std::size_t count) const {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = pread(file_, static_cast<char*>(bytes) + done, count - done,
                              static_cast<off_t>(begin + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw system_failure(folder_, "cannot read a temporary file", errno);
    done += static_cast<std::size_t>(got);
  }
}

}  // namespace libmap
