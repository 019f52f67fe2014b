// Runs a function in a child process, for libraries that can crash on damaged input files. A crash
// of the child does not end this process.
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

class SandboxedProcess {
 public:
  using Write = std::function<void(std::string_view bytes)>;

  // Calls work(write) in a child process without terminal output and with at most `max_data_bytes`
  // of memory. read() receives the bytes of `write`. Throws Error (failed) if no child can start.
  SandboxedProcess(std::uint64_t max_data_bytes, const std::function<void(const Write&)>& work);
  ~SandboxedProcess();  // ends the child
  SandboxedProcess(const SandboxedProcess&) = delete;
  SandboxedProcess& operator=(const SandboxedProcess&) = delete;

  // Reads the next bytes. Returns false if the child ended before it had written `count` bytes.
  bool read(void* bytes, std::size_t count);
  // Closes the connection, waits for the child. Returns "", or e.g. " (signal 11)" after a crash.
  std::string end();

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const;
  };

  int process_ = -1;
  std::unique_ptr<std::FILE, CloseFile> pipe_;
};

// Sends a result from the child process. Has the same functions as SandboxReader, so that one
// template both sends and receives a result.
class SandboxWriter {
 public:
  explicit SandboxWriter(const SandboxedProcess::Write& write) : write_(write) {}

  // Sends a number or a trivially copyable struct.
  template <typename Value>
  void value(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    write_({reinterpret_cast<const char*>(&value), sizeof value});
  }
  // Sends the length of an array.
  template <typename Array>
  void size(const Array& values) {
    value(std::uint64_t{values.size()});
  }
  template <typename Array>
  void array(const Array& values) {
    size(values);
    write_({reinterpret_cast<const char*>(values.data()), values.size() * sizeof values[0]});
  }
  // Sends an Error (without its file), or nullptr for success.
  void error(const Error* error);

 private:
  const SandboxedProcess::Write& write_;
};

// Receives a result in the parent process. If the data end too early, each function throws Error
// with the reason `broken` + SandboxedProcess::end().
class SandboxReader {
 public:
  SandboxReader(SandboxedProcess& process, std::string broken)
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
  // Throws the sent Error, if any.
  void error();

 private:
  void read(void* bytes, std::size_t count) {
    if (!process_.read(bytes, count)) throw Error(broken_ + process_.end());
  }

  SandboxedProcess& process_;
  std::string broken_;
};

// Calls make() in a child process and returns the result or throws the Error of make(). pass(io,
// result) transfers the result: `io` is a SandboxWriter in the child and a SandboxReader in this
// process. Throws Error with the reason `broken` if the child crashes.
template <typename Result, typename Make, typename Pass>
Result run_sandboxed(std::uint64_t max_data_bytes, const std::string& broken, const Make& make,
                     const Pass& pass) {
  SandboxedProcess process(max_data_bytes, [&](const SandboxedProcess::Write& write) {
    SandboxWriter output(write);
    try {
      Result result = make();
      output.error(nullptr);
      pass(output, result);
    } catch (const Error& error) {
      output.error(&error);
    }
  });
  SandboxReader input(process, broken);
  input.error();
  Result result;
  pass(input, result);
  return result;
}

}  // namespace libmap
