// Arrays, numbers and Errors through the pipe of a GuardedProcess.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "libmap/core/error.h"
#include "libmap/core/guarded_process.h"

namespace libmap {

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
inline void send_error(const GuardedProcess::Write& write, const Error* error) {
  send_array(write, error == nullptr ? std::string() : error->reason());
  if (error == nullptr) return;
  for (const std::string& text :
       {error->context().field, error->context().value, error->context().bound})
    send_array(write, text);
  send_value(write, error->kind());
}
inline void receive_error(GuardedProcess& process, std::string_view broken) {
  std::string reason;
  receive_array(process, broken, reason);
  if (reason.empty()) return;
  ErrorContext context;
  for (std::string* text : {&context.field, &context.value, &context.bound})
    receive_array(process, broken, *text);
  ErrorKind kind = ErrorKind::bad_input;
  receive_value(process, broken, kind);
  throw Error(reason, context, kind);
}

}  // namespace libmap
