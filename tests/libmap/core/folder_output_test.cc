#include "libmap/core/file_output.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/file_names.h"
#include "tests/support/test_support.h"

namespace folder_output_test {

namespace fs = std::filesystem;
using graspmap_test::names_in;
using libmap::OutputFolder;

const std::vector<std::string> names = {"a.txt", "b"};

void fill(const OutputFolder& output, const std::string& text) {
  graspmap_test::write_text(output.temporary_path() / "a.txt", text);
  fs::create_directory(output.temporary_path() / "b");
  graspmap_test::write_text(output.temporary_path() / "b/c.txt", text);
}

class OutputFolderTest : public testing::Test {
 protected:
  fs::path scratch_ = graspmap_test::scratch_folder();
  fs::path folder_ = scratch_ / "out";
};

TEST_F(OutputFolderTest, AppearsOnCommit) {
  OutputFolder output(folder_, names);
  fill(output, "one");
  EXPECT_FALSE(fs::exists(folder_));
  output.commit();
  EXPECT_EQ(names_in(scratch_), std::vector<std::string>{"out"});
  EXPECT_EQ(graspmap_test::read_text(folder_ / "b/c.txt"), "one");
}

TEST_F(OutputFolderTest, LeavesNothingWithoutCommit) {
  {
    const OutputFolder output(folder_, names);
    fill(output, "one");
  }
  EXPECT_EQ(names_in(scratch_), std::vector<std::string>{});
}

TEST_F(OutputFolderTest, ReplacesTheEarlierOneAsAWhole) {
  fs::create_directories(folder_ / "b");
  graspmap_test::write_text(folder_ / "b/old.txt", "old");
  {
    const OutputFolder dropped(folder_, names);
    fill(dropped, "one");
  }
  EXPECT_EQ(names_in(folder_ / "b"), std::vector<std::string>{"old.txt"});
  OutputFolder output(folder_.string() + "/", names);
  fill(output, "two");
  EXPECT_EQ(names_in(folder_ / "b"), std::vector<std::string>{"old.txt"});
  output.commit();
  EXPECT_EQ(names_in(scratch_), std::vector<std::string>{"out"});
  EXPECT_EQ(names_in(folder_ / "b"), std::vector<std::string>{"c.txt"});
}

TEST_F(OutputFolderTest, KeepsForeignContent) {
  fs::create_directory(folder_);
  graspmap_test::write_text(folder_ / "thesis.tex", "mine");
  const libmap::Error error = graspmap_test::error_of([&] { OutputFolder(folder_, names); });
  EXPECT_TRUE(graspmap_test::is_error(error, {.file = "out"}));
  EXPECT_EQ(names_in(folder_), std::vector<std::string>{"thesis.tex"});
  EXPECT_EQ(names_in(scratch_), std::vector<std::string>{"out"});
}

TEST_F(OutputFolderTest, RefusesPathsOfNoUse) {
  graspmap_test::write_text(scratch_ / "file", "");
  fs::create_directory_symlink(scratch_, scratch_ / "link");
  for (const auto& [name, fault] : {std::pair{"file", "a folder"},
                                    {"link", "a folder"},
                                    {"missing/out", "no such"},
                                    {".", "by its name"},
                                    {"..", "by its name"}}) {
    const fs::path path = scratch_ / name;
    EXPECT_TRUE(graspmap_test::is_error(graspmap_test::error_of([&] { OutputFolder(path, names); }),
                                        {.file = path, .about = fault}));
  }
}

TEST_F(OutputFolderTest, TakesOverWhatAKilledRunLeft) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const OutputFolder output(folder_, names);
    fill(output, "killed");
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  ASSERT_FALSE(fs::exists(folder_));
  ASSERT_EQ(names_in(scratch_).size(), 1U);
  OutputFolder output(folder_, names);
  EXPECT_EQ(names_in(output.temporary_path()), std::vector<std::string>{});
  output.commit();
  EXPECT_EQ(names_in(scratch_), std::vector<std::string>{"out"});
}

TEST_F(OutputFolderTest, KeepsTheEarlierOneIfItsOwnIsGone) {
  for (const bool has_earlier : {false, true}) {
    if (has_earlier) {
      fs::create_directory(folder_);
      graspmap_test::write_text(folder_ / "a.txt", "old");
    }
    OutputFolder output(folder_, names);
    fill(output, "new");
    fs::remove_all(output.temporary_path());
    const libmap::Error error = graspmap_test::error_of([&] { output.commit(); });
    EXPECT_TRUE(graspmap_test::is_error(error, {.file = "out", .kind = libmap::ErrorKind::failed}));
    EXPECT_EQ(error.context().file, folder_.string());
    EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
    EXPECT_EQ(fs::exists(folder_ / "a.txt"), has_earlier);
  }
}

TEST_F(OutputFolderTest, BelongsToOneAtATime) {
  OutputFolder output(folder_, names);
  const libmap::Error error = graspmap_test::error_of([&] { OutputFolder(folder_, names); });
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
  output.commit();
  EXPECT_NO_THROW(OutputFolder(folder_, names));
}

}  // namespace folder_output_test
