#include "libmap/core/output_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace libmap {

namespace fs = std::filesystem;

Error system_failure(const fs::path& path, const std::string& what, int code) {
  const std::string message = code == 0 ? "" : std::string(": ") + std::strerror(code);
  return Error(what + message, {.file = path.string()}, ErrorKind::failed);
}

void sync_file(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw system_failure(path, "cannot be opened for syncing", errno);
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
  if (flock(lock.descriptor_, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return std::nullopt;
    throw system_failure(path, "cannot be locked", errno);
  }
  return lock;
}

}  // namespace libmap
