// The one exception type of the project. It says which file, which field, which value and which
// bound; a command prints what() as one line and ends with the exit code of its kind.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace libmap {

// bad_input: the user's file, option or data cannot be used (exit code 3).
// failed: the run itself went wrong, for instance a full disk (exit code 1).
enum class ErrorKind { bad_input, failed };

struct ErrorContext {
  std::string file{};   // as the user named it
  std::string field{};  // column, key, header line or option
  std::string value{};  // what stood there
  std::string bound{};  // what would have been accepted, e.g. "> 0"
};

class Error : public std::runtime_error {
 public:
  // what() is "FILE: FIELD is VALUE: REASON (must be BOUND)"; empty parts are left out.
  explicit Error(std::string reason, ErrorContext context = {},
                 ErrorKind kind = ErrorKind::bad_input);

  const ErrorContext& context() const { return context_; }
  const std::string& reason() const { return reason_; }
  ErrorKind kind() const { return kind_; }

  // The same error naming `file`, unless it names one already.
  Error in_file(const std::string& file) const;
  // The same error of a field within `place`: "PLACE: FIELD", or the place where it names no field.
  Error in_field(const std::string& place, const char* joint = ": ") const;

 private:
  std::string reason_;
  ErrorContext context_;
  ErrorKind kind_;
};

// The result of `step`; its Errors that name no file name `file`.
template <typename Step>
auto in_file(const std::filesystem::path& file, const Step& step) {
  try {
    return step();
  } catch (const Error& error) {
    throw error.in_file(file.string());
  }
}

// The same of a field: what its Errors name is in `place`.
template <typename Step>
auto in_field(const std::string& place, const Step& step) {
  try {
    return step();
  } catch (const Error& error) {
    throw error.in_field(place);
  }
}

}  // namespace libmap
