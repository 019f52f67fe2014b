#include "tests/support/test_support.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

namespace graspmap_test {

namespace fs = std::filesystem;

std::mt19937_64& random_engine() {
  static std::mt19937_64 engine;
  return engine;
}

double uniform(double low, double high) {
  // Not std::uniform_real_distribution: its draws differ between standard libraries.
  const double unit = static_cast<double>(random_engine()() >> 11) * 0x1.0p-53;
  return low + (high - low) * unit;
}

namespace {

// Removes the scratch folder of a test that passed; files of a failed test are kept.
class ScratchCleaner : public testing::EmptyTestEventListener {
 public:
  fs::path folder;
  void OnTestEnd(const testing::TestInfo& info) override {
    if (!folder.empty() && info.result()->Passed()) fs::remove_all(folder);
    // Removes the folder of this process if it is empty.
    std::error_code not_empty;
    if (!folder.empty()) fs::remove(folder.parent_path(), not_empty);
    folder.clear();
  }
};

ScratchCleaner& cleaner() {
  static auto* const instance = [] {
    auto* made = new ScratchCleaner;
    testing::UnitTest::GetInstance()->listeners().Append(made);
    return made;
  }();
  return *instance;
}

fs::path folder_from(const char* variable) {
  const char* value = std::getenv(variable);
  return value == nullptr ? fs::path() : fs::path(value);
}

}  // namespace

fs::path scratch_folder() {
  const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(info->test_suite_name()) + "." + info->name();
  for (char& c : name)
    if (c == '/') c = '_';
  const fs::path folder =
      fs::temp_directory_path() / ("graspmap-test-" + std::to_string(getpid())) / name;
  if (cleaner().folder != folder) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    cleaner().folder = folder;
  }
  return folder;
}

fs::path source_folder() { return GRASPMAP_SOURCE_DIR; }
fs::path build_folder() { return GRASPMAP_BINARY_DIR; }
fs::path data_folder() { return folder_from("GRASPMAP_DATA"); }
fs::path reference_folder() { return folder_from("GRASPMAP_REFERENCE"); }

libmap::Error error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const libmap::Error& error) {
    return error;
  }
  ADD_FAILURE() << "no Error was thrown";
  return libmap::Error("none");
}

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  ASSERT_TRUE(file) << path;
}

}  // namespace graspmap_test
