#include "libmap/core/output_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace libmap {

namespace fs = std::filesystem;

namespace {

bool is_still_named(int descriptor, const fs::path& path) {
  struct stat held {};
  struct stat named {};
  return fstat(descriptor, &held) == 0 && stat(path.c_str(), &named) == 0 &&
         held.st_dev == named.st_dev && held.st_ino == named.st_ino;
}

}  // namespace

Error system_failure(const fs::path& path, const std::string& what, int code) {
  return Error(what + ": " + std::strerror(code), {.file = path.string()}, ErrorKind::failed);
}

void sync_file(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw system_failure(path, "cannot be opened to sync it", errno);
  const int result = fsync(descriptor);
  const int code = errno;
  close(descriptor);
  if (result != 0) throw system_failure(path, "cannot be synced", code);
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

namespace {

int open_lock(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (descriptor < 0) throw system_failure(path, "cannot be written", errno);
  return descriptor;
}

}  // namespace

FileLock::FileLock(const fs::path& path) : descriptor_(open_lock(path)) {
  while (flock(descriptor_, LOCK_EX) != 0) {
    if (errno == EINTR) continue;
    const int code = errno;
    close(descriptor_);
    throw system_failure(path, "cannot be locked", code);
  }
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

std::optional<FileLock> FileLock::try_lock(const fs::path& path) {
  FileLock lock(open_lock(path));
  if (flock(lock.descriptor_, LOCK_EX | LOCK_NB) != 0) return std::nullopt;
  return lock;
}

int lock_temporary(const fs::path& temporary, const fs::path& final_path,
                   const std::function<int(const char*)>& open_temporary) {
  for (;;) {
    const int lock = open_temporary(temporary.c_str());
    if (lock < 0 && errno == ENOENT && fs::is_directory(folder_of(temporary))) continue;
    if (lock < 0) throw system_failure(final_path, "cannot be written", errno);
    // NFS locks no folder that is open for reading (EBADF): it goes without.
    if (flock(lock, LOCK_EX | LOCK_NB) != 0 && errno != EBADF) {
      const int code = errno;
      close(lock);
      if (code != EWOULDBLOCK) throw system_failure(final_path, "cannot be locked", code);
      throw Error("another process is writing it", {.file = final_path.string()},
                  ErrorKind::failed);
    }
    // Between opening and locking, another process may have put this very file in place.
    if (is_still_named(lock, temporary)) return lock;
    close(lock);
  }
}

}  // namespace libmap
