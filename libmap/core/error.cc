#include "libmap/core/error.h"

#include <utility>

namespace libmap {

namespace {

std::string compose(const std::string& reason, const ErrorContext& context) {
  std::string line;
  if (!context.file.empty()) line += context.file + ": ";
  if (!context.field.empty()) {
    line += context.field;
    if (!context.value.empty()) line += " is " + context.value;
    line += ": ";
  } else if (!context.value.empty()) {
    line += "'" + context.value + "': ";
  }
  line += reason;
  if (!context.bound.empty()) line += " (must be " + context.bound + ")";
  return line;
}

}  // namespace

Error::Error(std::string reason, ErrorContext context, ErrorKind kind)
    : std::runtime_error(compose(reason, context)),
      reason_(std::move(reason)),
      context_(std::move(context)),
      kind_(kind) {}

Error Error::in_file(const std::string& file) const {
  ErrorContext context = context_;
  if (context.file.empty()) context.file = file;
  return Error(reason_, std::move(context), kind_);
}

Error Error::in_field(const std::string& prefix, const char* joint) const {
  ErrorContext context = context_;
  context.field = context.field.empty() ? prefix : prefix + joint + context.field;
  return Error(reason_, std::move(context), kind_);
}

Error no_elements(const std::string& elements, const std::filesystem::path& file) {
  return Error("there are none", {.file = file.string(), .field = elements});
}

}  // namespace libmap
