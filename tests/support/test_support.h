// What every test program shares.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <random>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/point_cloud.h"

namespace graspmap_test {

// A random engine that is seeded anew, with the same seed, before each test.
std::mt19937_64& random_engine();
double uniform(double low, double high);

// An empty folder of this test alone, removed when the test ends well.
std::filesystem::path scratch_folder();

// The project's source folder and build folder.
std::filesystem::path source_folder();
std::filesystem::path build_folder();

// $GRASPMAP_DATA and $GRASPMAP_REFERENCE; empty if not set.
std::filesystem::path data_folder();
std::filesystem::path reference_folder();

// The Error that `action` throws; a failed test if it throws none.
libmap::Error error_of(const std::function<void()>& action);

std::string read_text(const std::filesystem::path& path);
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace graspmap_test

// At the top of a test on real data: skips it, by name, where the folder is not set.
#define GRASPMAP_REQUIRE_DATA() \
  if (graspmap_test::data_folder().empty()) GTEST_SKIP() << "GRASPMAP_DATA is not set"
#define GRASPMAP_REQUIRE_REFERENCE() \
  if (graspmap_test::reference_folder().empty()) GTEST_SKIP() << "GRASPMAP_REFERENCE is not set"
