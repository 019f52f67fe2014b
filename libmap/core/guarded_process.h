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
#include <utility>

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

// The two ends of the pipe. What passes a result through it is a template of the end, and so sends
// and receives the same.
class GuardedOutput {
 public:
  explicit GuardedOutput(const GuardedProcess::Write& write) : write_(write) {}

  // A number or a struct of numbers.
  template <typename Value>
  void value(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    write_({reinterpret_cast<const char*>(&value), sizeof value});
  }
  // The length of an array; then its values.
  template <typename Array>
  void size(const Array& values) {
    value(std::uint64_t{values.size()});
  }
  template <typename Array>
  void array(const Array& values) {
    size(values);
    write_({reinterpret_cast<const char*>(values.data()), values.size() * sizeof values[0]});
  }
  // An Error, or that there is none.
  void error(const Error* error);

 private:
  const GuardedProcess::Write& write_;
};

// Each throws Error with `broken` as reason, and how the process ended, if there is no more to
// read.
class GuardedInput {
 public:
  GuardedInput(GuardedProcess& process, std::string broken)
      : process_(process), broken_(std::move(broken)) {}

  template <typename Value>
  void value(Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    read(&value, sizeof value);
  }
  template <typename Array>
  void size(Array& values) {
    std::uint64_t count = 0;
    value(count);
    values.resize(count);
  }
  template <typename Array>
  void array(Array& values) {
    size(values);
    read(values.data(), values.size() * sizeof values[0]);
  }
  // Throws the Error, if there is one.
  void error();

 private:
  void read(void* bytes, std::size_t count) {
    if (!process_.read(bytes, count)) throw Error(broken_ + process_.end());
  }

  GuardedProcess& process_;
  std::string broken_;
};

// What make() returns or throws in a process of its own. pass(end, result) sends and receives it.
template <typename Result, typename Make, typename Pass>
Result run_guarded(std::uint64_t max_data_bytes, const std::string& broken, const Make& make,
                   const Pass& pass) {
  GuardedProcess process(max_data_bytes, [&](const GuardedProcess::Write& write) {
    GuardedOutput output(write);
    try {
      Result result = make();
      output.error(nullptr);
      pass(output, result);
    } catch (const Error& error) {
      output.error(&error);
    }
  });
  GuardedInput input(process, broken);
  input.error();
  Result result;
  pass(input, result);
  return result;
}

}  // namespace libmap
