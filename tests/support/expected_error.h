// Expects errors by their parts, so that a message can be reworded without changing tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "libmap/core/error.h"

namespace graspmap_test {

// Empty parts are not compared, except the kind.
struct ExpectedError {
  std::filesystem::path file{};
  std::string field{};
  std::string value{};
  std::string bound{};
  // A name or number in the reason, for an error that its other parts do not identify.
  std::string about{};
  libmap::ErrorKind kind = libmap::ErrorKind::bad_input;
};

testing::AssertionResult is_error(const libmap::Error& error, const ExpectedError& expected);

// Compares the text of an error, "FILE: FIELD is VALUE: REASON (must be BOUND)", as a command
// prints it, or of a warning of this form. Does not compare the kind.
testing::AssertionResult is_error_text(const std::string& text, const ExpectedError& expected);

}  // namespace graspmap_test
