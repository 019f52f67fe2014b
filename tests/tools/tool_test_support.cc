#include "tests/tools/tool_test_support.h"

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "tests/support/file_names.h"

namespace graspmap_test {

namespace fs = std::filesystem;

namespace {

std::string told(const ProgramResult& result) {
  return "exit code " + std::to_string(result.exit_code) + "\nstderr: " + result.standard_error +
         "\nstdout: " + result.standard_output;
}

testing::AssertionResult failed_with(const ProgramResult& result, int exit_code, long lines,
                                     const std::vector<std::string>& parts) {
  const std::string& text = result.standard_error;
  if (result.exit_code != exit_code)
    return testing::AssertionFailure() << "not exit code " << exit_code << ": " << told(result);
  if (std::count(text.begin(), text.end(), '\n') != lines || text.back() != '\n')
    return testing::AssertionFailure() << "not " << lines << " line(s): " << told(result);
  const std::string first = text.substr(0, text.find('\n'));
  if (!first.starts_with("graspmap") || first.find(": error: ") == std::string::npos)
    return testing::AssertionFailure() << "no error line: " << told(result);
  for (const std::string& part : parts)
    if (first.find(part) == std::string::npos)
      return testing::AssertionFailure() << "does not say '" << part << "': " << told(result);
  if (!result.standard_output.empty())
    return testing::AssertionFailure() << "something on stdout: " << told(result);
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

testing::AssertionResult bad_input(const ProgramResult& result,
                                   const std::vector<std::string>& parts) {
  return failed_with(result, 3, 1, parts);
}

testing::AssertionResult wrong_usage(const ProgramResult& result,
                                     const std::vector<std::string>& parts) {
  return failed_with(result, 2, 1, parts);
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
