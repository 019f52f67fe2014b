// Helpers of the tests that run `graspmap` as a user does.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "tests/support/run_program.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

// `graspmap WORDS...`, run in the test's scratch folder, so that files go by their plain names.
ProgramResult graspmap(std::vector<std::string> words,
                       const std::map<std::string, std::string>& environment = {});

// Ended well; says what the program said if not.
testing::AssertionResult succeeded(const ProgramResult& result);

// Ended with exit code 3 and one line on stderr that begins with "graspmap COMMAND: error: " and
// holds each of `parts`.
testing::AssertionResult bad_input(const ProgramResult& result,
                                   const std::vector<std::string>& parts);

// The same of exit code 2: wrong usage.
testing::AssertionResult wrong_usage(const ProgramResult& result,
                                     const std::vector<std::string>& parts);

// A file in the scratch folder.
std::filesystem::path scratch(const std::string& name);
std::vector<std::string> names_in_scratch();
std::string content(const std::string& name);
nlohmann::json json_of(const std::string& name);

// The files of a folder in the scratch folder, by their names.
std::map<std::string, std::string> pieces_in(const std::string& folder);
// Expects the same pieces and results in both, and nothing left of their making.
void expect_same_pieces(const std::string& folder, const std::string& whole);

// Gently bumpy ground of 0.6 x 0.6 m about (0, 0), z up, a point each 5 mm and the same for every
// call. Coordinates are multiples of 2^-20 m: any format holds them exactly.
libmap::PointCloud bumpy_terrain(double size_m = 0.6);

// Writes it as terrain.pcd and returns that name.
std::string write_terrain();

}  // namespace graspmap_test
