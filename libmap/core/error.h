// The exception type of the project. It contains file, field, value and bound; a command prints
// what() as one line and exits with the exit code of the ErrorKind.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace libmap {

// bad_input: a file, an option or data is invalid (exit code 3).
// failed: the run failed, e.g. the disk is full (exit code 1). Comments write "Error (failed)".
enum class ErrorKind { bad_input, failed };

struct ErrorContext {
  std::string file{};   // as the user named it
  std::string field{};  // column, key, header line or option
  std::string value{};  // the rejected value
  std::string bound{};  // the accepted values, e.g. "> 0"
};

class Error : public std::runtime_error {
 public:
  // what() is "FILE: FIELD is VALUE: REASON (must be BOUND)", without the empty parts; without a
  // field, "FILE: 'VALUE': REASON (must be BOUND)".
  explicit Error(std::string reason, ErrorContext context = {},
                 ErrorKind kind = ErrorKind::bad_input);

  const ErrorContext& context() const { return context_; }
  const std::string& reason() const { return reason_; }
  ErrorKind kind() const { return kind_; }

  // Returns a copy with the file `file`; an unchanged copy if the error already names a file.
  Error in_file(const std::string& file) const;
  // Returns a copy with the field `prefix` + `joint` + present field; `prefix` if there is none.
  Error in_field(const std::string& prefix, const char* joint = ": ") const;

 private:
  std::string reason_;
  ErrorContext context_;
  ErrorKind kind_;
};

// Returns the error "FILE: ELEMENTS: there are none", e.g. of a cloud without points; `file` may be
// empty.
Error no_elements(const std::string& elements, const std::filesystem::path& file = {});

// Returns step(). Adds `file` to Errors that `step` throws without a file.
template <typename Step>
auto in_file(const std::filesystem::path& file, const Step& step) {
  try {
    return step();
  } catch (const Error& error) {
    throw error.in_file(file.string());
  }
}

// Returns step(). Changes the field of Errors that `step` throws, as Error::in_field does.
template <typename Step>
auto in_field(const std::string& prefix, const Step& step) {
  try {
    return step();
  } catch (const Error& error) {
    throw error.in_field(prefix);
  }
}

}  // namespace libmap
