#include "tests/tools/tool_test_support.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "libmap/io/cloud_io.h"
#include "tests/support/file_names.h"

namespace graspmap_test {

namespace fs = std::filesystem;

namespace {

std::string told(const ProgramResult& result) {
  return "exit code " + std::to_string(result.exit_code) + "\nstderr: " + result.standard_error +
         "\nstdout: " + result.standard_output;
}

// Expects the exit code and one error line; writes the error's text to `error`.
testing::AssertionResult failed_with(const ProgramResult& result, int exit_code,
                                     std::string& error) {
  const std::string& text = result.standard_error;
  if (result.exit_code != exit_code)
    return testing::AssertionFailure() << "not exit code " << exit_code << ": " << told(result);
  if (std::count(text.begin(), text.end(), '\n') != 1 || text.back() != '\n')
    return testing::AssertionFailure() << "not one line: " << told(result);
  const std::string mark = ": error: ";
  const std::size_t at = text.find(mark);
  if (!text.starts_with("graspmap") || at == std::string::npos)
    return testing::AssertionFailure() << "no error line: " << told(result);
  if (!result.standard_output.empty())
    return testing::AssertionFailure() << "something on stdout: " << told(result);
  error = text.substr(at + mark.size(), text.size() - 1 - at - mark.size());
  return testing::AssertionSuccess();
}

double rounded(double value) { return std::round(value * 0x1p20) / 0x1p20; }

}  // namespace

ProgramResult graspmap(std::vector<std::string> words,
                       const std::map<std::string, std::string>& environment) {
  words.insert(words.begin(), (build_folder() / "graspmap").string());
  return run_program(words, {.folder = scratch_folder(), .environment = environment});
}

testing::AssertionResult succeeded(const ProgramResult& result) {
  if (result.exit_code == 0) return testing::AssertionSuccess();
  return testing::AssertionFailure() << told(result);
}

testing::AssertionResult bad_input(const ProgramResult& result, const ExpectedError& expected) {
  std::string error;
  const testing::AssertionResult failed = failed_with(result, 3, error);
  return failed ? is_error_text(error, expected) : failed;
}

testing::AssertionResult ended_with(const ProgramResult& result, const ExpectedError& expected) {
  ProgramResult last = result;
  last.standard_output.clear();
  std::string& text = last.standard_error;
  const std::size_t line = text.size() < 2 ? std::string::npos : text.rfind('\n', text.size() - 2);
  if (line != std::string::npos) text.erase(0, line + 1);
  std::string error;
  const testing::AssertionResult failed =
      failed_with(last, expected.kind == libmap::ErrorKind::failed ? 1 : 3, error);
  return failed ? is_error_text(error, expected) : failed;
}

testing::AssertionResult wrong_usage(const ProgramResult& result,
                                     const std::vector<std::string>& names) {
  std::string error;
  const testing::AssertionResult failed = failed_with(result, 2, error);
  if (!failed) return failed;
  for (const std::string& name : names)
    if (error.find(name) == std::string::npos)
      return testing::AssertionFailure() << "does not name '" << name << "': " << error;
  return testing::AssertionSuccess();
}

testing::AssertionResult warned(const ProgramResult& result,
                                const std::vector<std::string>& names) {
  std::istringstream lines(result.standard_error);
  for (std::string line; std::getline(lines, line);) {
    const bool has_all = std::all_of(names.begin(), names.end(), [&](const std::string& name) {
      return line.find(name) != std::string::npos;
    });
    if (has_all && line.find(": warning: ") != std::string::npos)
      return testing::AssertionSuccess() << line;
  }
  std::string list;
  for (const std::string& name : names) list += " '" + name + "'";
  return testing::AssertionFailure() << "no warning with" << list << ": " << told(result);
}

fs::path scratch(const std::string& name) { return scratch_folder() / name; }

std::vector<std::string> names_in_scratch() { return names_in(scratch_folder()); }

std::string content(const std::string& name) { return read_text(scratch(name)); }

nlohmann::json json_of(const std::string& name) { return nlohmann::json::parse(content(name)); }

std::map<std::string, std::string> pieces_in(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(scratch(folder)))
    files[entry.path().filename()] = content(folder + "/" + entry.path().filename().string());
  return files;
}

void expect_same_tiles(const std::string& folder, const std::string& whole) {
  EXPECT_TRUE(pieces_in(folder) == pieces_in(whole));
  nlohmann::json own = json_of(folder + ".json");
  nlohmann::json other = json_of(whole + ".json");
  own.erase("run");
  other.erase("run");
  EXPECT_EQ(own, other);
  EXPECT_FALSE(std::filesystem::exists(scratch(folder + ".progress")));
}

libmap::PointCloud bumpy_terrain(double size_m) {
  // Always the same, whatever the test drew before.
  random_engine().seed(1);
  libmap::PointCloud cloud;
  const int half = static_cast<int>(size_m / 2 / 0.005);
  for (int i = -half; i < half; ++i)
    for (int j = -half; j < half; ++j) {
      const double x = (i + uniform(0.2, 0.8)) * 0.005;
      const double y = (j + uniform(0.2, 0.8)) * 0.005;
      const double z = 0.03 * std::sin(17 * x + 0.4) * std::cos(13 * y) + 0.004 * std::sin(90 * y);
      cloud.positions.emplace_back(rounded(x), rounded(y), rounded(z));
    }
  return cloud;
}

std::string write_terrain() {
  libmap::write_cloud(scratch("terrain.pcd"), bumpy_terrain());
  return "terrain.pcd";
}

}  // namespace graspmap_test
