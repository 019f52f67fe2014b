// Lowers a resource limit of the test's process during the lifetime of an object.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <csignal>

namespace graspmap_test {

class LowerLimit {
 public:
  using Resource = decltype(RLIMIT_AS);

  LowerLimit(Resource resource, rlim_t limit) : resource_(resource) {
    getrlimit(resource_, &before_);
    const rlimit lower{std::min(limit, before_.rlim_cur), before_.rlim_max};
    setrlimit(resource_, &lower);
  }
  ~LowerLimit() { setrlimit(resource_, &before_); }
  LowerLimit(const LowerLimit&) = delete;
  LowerLimit& operator=(const LowerLimit&) = delete;

 private:
  Resource resource_;
  rlimit before_{};
};

// Simulates a full disk: writes beyond this number of bytes per file fail.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes)
      : handler_(std::signal(SIGXFSZ, SIG_IGN)), limit_(RLIMIT_FSIZE, bytes) {}
  ~FileSizeLimit() { std::signal(SIGXFSZ, handler_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  void (*handler_)(int);
  LowerLimit limit_;
};

}  // namespace graspmap_test
