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
#include <type_traits>

#include "libmap/core/error.h"

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

// A number or a struct of numbers.
template <typename Value>
void send_value(const GuardedProcess::Write& write, const Value& value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  write({reinterpret_cast<const char*>(&value), sizeof value});
}

// The length of an array, then its bytes.
template <typename Array>
void send_array(const GuardedProcess::Write& write, const Array& values) {
  send_value(write, std::uint64_t{values.size()});
  write({reinterpret_cast<const char*>(values.data()), values.size() * sizeof values[0]});
}

// Throws Error with `broken` as reason, and how the process ended, if there is no more to read.
template <typename Value>
void receive_value(GuardedProcess& process, std::string_view broken, Value& value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  if (!process.read(&value, sizeof value)) throw Error(std::string(broken) + process.end());
}
// A count, then as many values; throws the same.
template <typename Array>
void receive_array(GuardedProcess& process, std::string_view broken, Array& values) {
  std::uint64_t count = 0;
  receive_value(process, broken, count);
  values.resize(count);
  if (!process.read(values.data(), count * sizeof values[0]))
    throw Error(std::string(broken) + process.end());
}

// The Error, or that there is none. receive_error throws it, or returns.
void send_error(const GuardedProcess::Write& write, const Error* error);
void receive_error(GuardedProcess& process, std::string_view broken);

}  // namespace libmap
