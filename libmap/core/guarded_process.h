// A process of its own for the work of libraries that follow broken input out of their buffers: if
// they fall, this process does not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace libmap {

class GuardedProcess {
 public:
  using Write = std::function<void(std::string_view bytes)>;

  // Calls work(write) there, silently, with `max_data_bytes` of memory at most; what it writes,
  // read() gives here. Throws Error (failed) if there can be no process.
  GuardedProcess(std::uint64_t max_data_bytes, const std::function<void(const Write&)>& work);
  ~GuardedProcess();  // it ends too
  GuardedProcess(const GuardedProcess&) = delete;
  GuardedProcess& operator=(const GuardedProcess&) = delete;

  // The next bytes. False if it ended before it had written so many.
  bool read(void* bytes, std::size_t count);
  // How it ended, after read() said false: "" or " (signal 11)".
  std::string end();

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const;
  };

  int process_ = -1;
  std::unique_ptr<std::FILE, CloseFile> pipe_;
};

}  // namespace libmap
