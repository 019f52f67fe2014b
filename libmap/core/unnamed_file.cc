#include "libmap/core/unnamed_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <string>
#include <utility>

#include "libmap/core/output_lock.h"

namespace libmap {

UnnamedFile::UnnamedFile(std::filesystem::path folder) : folder_(std::move(folder)) {
  // Without a name it goes with the process; not every file system has such.
  file_ = open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file_ >= 0) return;
  std::string name = (folder_ / ".unnamed-XXXXXX").string();
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) throw system_failure(folder_, "no file can be made in it", errno);
  unlink(name.c_str());
}

UnnamedFile::~UnnamedFile() { close(file_); }

std::uint64_t UnnamedFile::append(const void* bytes, std::size_t count) {
  std::uint64_t begin = 0;
  {
    const std::lock_guard lock(mutex_);
    begin = end_;
    end_ += count;
  }
  std::size_t done = 0;
  while (done < count) {
    const ssize_t written = pwrite(file_, static_cast<const char*>(bytes) + done, count - done,
                                   static_cast<off_t>(begin + done));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw system_failure(folder_, "what is kept in it cannot be written", errno);
    done += static_cast<std::size_t>(written);
  }
  return begin;
}

void UnnamedFile::read(std::uint64_t begin, void* bytes, std::size_t count) const {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = pread(file_, static_cast<char*>(bytes) + done, count - done,
                              static_cast<off_t>(begin + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw system_failure(folder_, "what is kept in it cannot be read", errno);
    done += static_cast<std::size_t>(got);
  }
}

}  // namespace libmap
