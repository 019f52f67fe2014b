// Compares errors by their parts, so that messages can be reworded without changing tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "libmap/core/error.h"

namespace graspmap_test {

// Expected parts of an error. Empty parts are not compared; the kind always is.
struct ExpectedError {
  std::filesystem::path file{};  // path or file name
  std::string field{};
  std::string value{};
  std::string bound{};
  // Text, e.g. a name, that the reason must contain if other parts do not identify the error.
  std::string about{};
  libmap::ErrorKind kind = libmap::ErrorKind::bad_input;
};

testing::AssertionResult is_error(const libmap::Error& error, const ExpectedError& expected);

// Compares the text of an error, "FILE: FIELD is VALUE: REASON (must be BOUND)", as a command
// prints it, or of a warning of this form. Does not compare the kind.
testing::AssertionResult is_error_text(const std::string& text, const ExpectedError& expected);

}  // namespace graspmap_test
