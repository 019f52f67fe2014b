#include "tests/support/expected_error.h"

#include <algorithm>
#include <vector>

namespace graspmap_test {

namespace {

// Returns the possible beginnings of the text of an error with the expected file, field and value.
std::vector<std::string> beginnings(const ExpectedError& expected) {
  const std::string file = expected.file.empty() ? "" : expected.file.string() + ": ";
  if (expected.field.empty())
    return {file + (expected.value.empty() ? "" : "'" + expected.value + "': ")};
  if (expected.value.empty()) return {file + expected.field + ": ", file + expected.field + " is "};
  return {file + expected.field + " is " + expected.value + ": "};
}

}  // namespace

testing::AssertionResult is_error(const libmap::Error& error, const ExpectedError& expected) {
  const libmap::ErrorContext& context = error.context();
  const auto differs = [](const std::string& part, const std::string& expected_part) {
    return !expected_part.empty() && part != expected_part;
  };
  const bool other_file = differs(context.file, expected.file.string()) &&
                          std::filesystem::path(context.file).filename() != expected.file;
  const char* part = other_file                                                 ? "file"
                     : differs(context.field, expected.field)                   ? "field"
                     : differs(context.value, expected.value)                   ? "value"
                     : differs(context.bound, expected.bound)                   ? "bound"
                     : error.kind() != expected.kind                            ? "kind"
                     : error.reason().find(expected.about) == std::string::npos ? "reason"
                                                                                : nullptr;
  if (part == nullptr) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << "another " << part << " than expected: " << error.what() << "\nfile '" << context.file
         << "', field '" << context.field << "', value '" << context.value << "', bound '"
         << context.bound << "', kind " << static_cast<int>(error.kind());
}

testing::AssertionResult is_error_text(const std::string& text, const ExpectedError& expected) {
  const std::vector<std::string> allowed = beginnings(expected);
  const auto begins = [&](const std::string& beginning) {
    return text.starts_with(beginning) ||
           (expected.file.empty() && text.find(": " + beginning) != std::string::npos);
  };
  const bool ends = expected.bound.empty() || text.ends_with("(must be " + expected.bound + ")");
  if (std::any_of(allowed.begin(), allowed.end(), begins) && ends &&
      text.find(expected.about) != std::string::npos)
    return testing::AssertionSuccess();
  return testing::AssertionFailure() << "not '" << allowed.front() << "... " << expected.about
                                     << " ... " << expected.bound << "': " << text;
}

}  // namespace graspmap_test
