// Functions for all test programs.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <random>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/point_cloud.h"
#include "tests/support/expected_error.h"

namespace graspmap_test {

// Random engine with the same seed at the start of each test. uniform() draws from [low, high).
std::mt19937_64& random_engine();
double uniform(double low, double high);

// Returns an empty folder for this test only, which is removed if the test passes.
std::filesystem::path scratch_folder();

// The project's source folder and build folder.
std::filesystem::path source_folder();
std::filesystem::path build_folder();

// Folders in the variables $GRASPMAP_DATA and $GRASPMAP_REFERENCE; empty if not set.
std::filesystem::path data_folder();
std::filesystem::path reference_folder();

// Returns the Error that `action` throws; the test fails if it throws no Error.
[[nodiscard]] libmap::Error error_of(const std::function<void()>& action);

std::string read_text(const std::filesystem::path& path);
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace graspmap_test

// Skips a test on real data, naming the variable, if the folder is not set.
#define GRASPMAP_REQUIRE_DATA() \
  if (graspmap_test::data_folder().empty()) GTEST_SKIP() << "GRASPMAP_DATA is not set"
#define GRASPMAP_REQUIRE_REFERENCE() \
  if (graspmap_test::reference_folder().empty()) GTEST_SKIP() << "GRASPMAP_REFERENCE is not set"
