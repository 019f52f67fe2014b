// Helpers for tests that run the `graspmap` program.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "tests/support/expected_error.h"
#include "tests/support/run_program.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

// Runs `graspmap WORDS...` in the test's scratch folder; file names are relative to it.
ProgramResult graspmap(std::vector<std::string> words,
                       const std::map<std::string, std::string>& environment = {});

// Success for exit code 0; else a failure with the program's messages.
testing::AssertionResult succeeded(const ProgramResult& result);

// Success for exit code 3 and one line on stderr, "graspmap COMMAND: error: ..." with the expected
// parts of the error.
testing::AssertionResult bad_input(const ProgramResult& result, const ExpectedError& expected);

// Success for the exit code of the expected kind and an error line as in bad_input, which is the
// last line on stderr; warnings may precede it.
testing::AssertionResult ended_with(const ProgramResult& result, const ExpectedError& expected);

// Success for exit code 2 (wrong usage) and an error line that contains these names of commands,
// options, arguments or files.
testing::AssertionResult wrong_usage(const ProgramResult& result,
                                     const std::vector<std::string>& names);

// Success if one warning on stderr contains these names of files, fields, options or quantities,
// and these numbers. Without names: any warning.
testing::AssertionResult warned(const ProgramResult& result, const std::vector<std::string>& names);

// Return the path of a file in the scratch folder, the names of all files there, and the content of
// a file as text and as JSON.
std::filesystem::path scratch(const std::string& name);
std::vector<std::string> names_in_scratch();
std::string content(const std::string& name);
nlohmann::json json_of(const std::string& name);

// Returns the contents of the files of a folder in the scratch folder, by name.
std::map<std::string, std::string> pieces_in(const std::string& folder);
// Expects equal tiles and results in both folders, and no temporary files.
void expect_same_tiles(const std::string& folder, const std::string& whole);

// Returns bumpy ground of size_m x size_m around (0, 0), z up, with a point spacing of 5 mm, the
// same for every call. Coordinates are multiples of 2^-20 m, which any format stores exactly.
libmap::PointCloud bumpy_terrain(double size_m = 0.6);

// Writes bumpy_terrain() as terrain.pcd. Returns this name.
std::string write_terrain();

}  // namespace graspmap_test
