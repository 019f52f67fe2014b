#include "libmap/core/file_output.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <optional>

#include "libmap/core/error.h"
#include "tests/support/file_names.h"
#include "tests/support/test_support.h"

namespace file_output_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::names_in;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using libmap::ErrorKind;
using libmap::OutputFile;

TEST(FileOutputTest, CommittedFileIsWholeAndAlone) {
  const fs::path path = scratch_folder() / "map.pcd";
  OutputFile output(path);
  EXPECT_EQ(output.final_path(), path);
  EXPECT_EQ(output.temporary_path().extension(), ".pcd") << "writers choose the format by it";
  EXPECT_EQ(output.temporary_path().parent_path(), path.parent_path());
  libmap::write_text(output.temporary_path(), "content");
  EXPECT_FALSE(fs::exists(path)) << "not there before the commit";
  output.commit();
  EXPECT_EQ(read_text(path), "content");
  EXPECT_EQ(names_in(scratch_folder()), std::vector<std::string>{"map.pcd"});
}

TEST(FileOutputTest, WithoutCommitNothingChanges) {
  const fs::path path = scratch_folder() / "map.pcd";
  graspmap_test::write_text(path, "old");
  {
    const OutputFile output(path);
    libmap::write_text(output.temporary_path(), "new");
  }
  EXPECT_EQ(read_text(path), "old");
  EXPECT_EQ(names_in(scratch_folder()), std::vector<std::string>{"map.pcd"});
}

TEST(FileOutputTest, AnExceptionLeavesNothing) {
  try {
    const OutputFile output(scratch_folder() / "map.csv");
    libmap::write_text(output.temporary_path(), "half");
    throw std::runtime_error("in the middle");
  } catch (const std::runtime_error&) {
  }
  EXPECT_TRUE(names_in(scratch_folder()).empty());
}

TEST(FileOutputTest, CommitReplacesAnEarlierOutput) {
  const fs::path path = scratch_folder() / "map.csv";
  libmap::write_whole_file(path, "a longer first content");
  libmap::write_whole_file(path, "second");
  EXPECT_EQ(read_text(path), "second");
}

TEST(FileOutputTest, SecondWriterIsRefusedWhileTheFirstLives) {
  const fs::path path = scratch_folder() / "map.csv";
  std::optional<OutputFile> first(std::in_place, path);
  const libmap::Error error = error_of([&] { const OutputFile second(path); });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_EQ(error.context().file, path.string());
  libmap::write_text(first->temporary_path(), "first");
  first->commit();
  first.reset();
  EXPECT_EQ(read_text(path), "first") << "the refused one did no harm";
  libmap::write_whole_file(path, "third");
  EXPECT_EQ(read_text(path), "third");
}

TEST(FileOutputTest, SecondProcessIsRefusedWhileTheFirstLives) {
  const fs::path path = scratch_folder() / "map.csv";
  const OutputFile first(path);
  const pid_t child = fork();
  if (child == 0) {
    try {
      const OutputFile second(path);
    } catch (const libmap::Error&) {
      _exit(7);
    }
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  EXPECT_TRUE(fs::exists(first.temporary_path())) << "the first one's temporary is still its own";
}

TEST(FileOutputTest, AKilledWriterDoesNotBlockTheNext) {
  const fs::path path = scratch_folder() / "map.csv";
  const pid_t child = fork();
  if (child == 0) {
    const OutputFile output(path);
    libmap::write_text(output.temporary_path(), "a very long content that was never finished");
    _exit(0);  // no destructor, as in a killed process
  }
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::exists(path));
  libmap::write_whole_file(path, "next");
  EXPECT_EQ(read_text(path), "next");
  EXPECT_EQ(names_in(scratch_folder()), std::vector<std::string>{"map.csv"});
}

TEST(FileOutputTest, MovedOutputIsRemovedOnce) {
  const fs::path path = scratch_folder() / "map.csv";
  {
    OutputFile first(path);
    OutputFile second(std::move(first));
    libmap::write_text(second.temporary_path(), "moved");
    second.commit();
  }
  EXPECT_EQ(names_in(scratch_folder()), std::vector<std::string>{"map.csv"});
}

TEST(FileOutputTest, OutputsOfOneStemDoNotMeet) {
  const OutputFile pcd(scratch_folder() / "map.pcd");
  const OutputFile csv(scratch_folder() / "map.csv");
  const OutputFile manifest(scratch_folder() / "map.csv.json");
  EXPECT_EQ(names_in(scratch_folder()).size(), 3U);
}

TEST(FileOutputTest, MissingFolderAndFolderAsTarget) {
  const fs::path missing = scratch_folder() / "none" / "map.csv";
  EXPECT_EQ(error_of([&] { const OutputFile output(missing); }).context().file, missing.string());
  EXPECT_EQ(error_of([&] { const OutputFile output(missing); }).kind(), ErrorKind::bad_input);
  const fs::path folder = scratch_folder() / "folder";
  fs::create_directory(folder);
  EXPECT_TRUE(is_error(error_of([&] { const OutputFile output(folder); }),
                       {.file = graspmap_test::scratch_folder() / "folder"}));
  EXPECT_TRUE(
      is_error(error_of([&] { const OutputFile output(folder / ""); }), {.file = folder / ""}));
  EXPECT_TRUE(is_error(error_of([&] { const OutputFile output(fs::path{}); }), {}));
  graspmap_test::write_text(scratch_folder() / "file", "");
  EXPECT_TRUE(
      is_error(error_of([&] { const OutputFile output(scratch_folder() / "file" / "map.csv"); }),
               {.file = scratch_folder() / "file" / "map.csv"}));
  EXPECT_TRUE(names_in(folder).empty());
}

TEST(FileOutputTest, DeviceOrPipeIsNotReplaced) {
  const fs::path pipe = scratch_folder() / "pipe.csv";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_TRUE(is_error(error_of([&] { const OutputFile output(pipe); }), {.file = pipe}));
  EXPECT_EQ(names_in(scratch_folder()), std::vector<std::string>{"pipe.csv"});
}

TEST(FileOutputTest, LinkInThePlaceOfTheTemporaryIsNotFollowed) {
  const fs::path path = scratch_folder() / "map.csv";
  const fs::path victim = scratch_folder() / "victim";
  graspmap_test::write_text(victim, "precious");
  fs::path temporary;
  {
    const OutputFile output(path);
    temporary = output.temporary_path();
  }
  fs::create_symlink(victim, temporary);
  EXPECT_TRUE(is_error(error_of([&] { const OutputFile output(path); }),
                       {.file = path, .kind = ErrorKind::failed}));
  EXPECT_EQ(read_text(victim), "precious");
}

TEST(FileOutputTest, ReadsBytesAsTheyAre) {
  const fs::path path = scratch_folder() / "bytes";
  const std::string bytes("\0\r\n\xFF\x1A", 5);
  libmap::write_whole_file(path, bytes);
  EXPECT_EQ(libmap::read_whole_file(path), bytes);
  libmap::write_whole_file(path, "");
  EXPECT_EQ(libmap::read_whole_file(path), "");
}

TEST(FileOutputTest, ReadingRefusesWhatIsNoFile) {
  const fs::path missing = scratch_folder() / "none";
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_whole_file(missing); }), {.file = missing}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_whole_file(scratch_folder()); }),
                       {.file = scratch_folder()}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::require_readable_file("/dev/null"); }),
                       {.file = "/dev/null"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::require_readable_file(""); }), {}));
}

// Drops the superuser's rights for tests that are run by root.
class AsSomebodyElse {
 public:
  AsSomebodyElse() : good_(getuid() != 0 || setresuid(65534, 0, 0) == 0) {}
  ~AsSomebodyElse() {
    if (geteuid() == 0) {
      EXPECT_EQ(setresuid(0, 0, 0), 0);
    }
  }
  AsSomebodyElse(const AsSomebodyElse&) = delete;
  AsSomebodyElse& operator=(const AsSomebodyElse&) = delete;
  bool good() const { return good_; }

 private:
  bool good_;
};

TEST(FileOutputTest, ReadingRefusesWhatIsNotAllowed) {
  const fs::path path = scratch_folder() / "secret";
  graspmap_test::write_text(path, "12345");
  fs::permissions(path, fs::perms::none);
  const AsSomebodyElse somebody;
  if (!somebody.good()) GTEST_SKIP() << "there is nobody else here";
  const libmap::Error error = error_of([&] { libmap::require_readable_file(path); });
  EXPECT_TRUE(is_error(error, {.file = "secret"}));
  EXPECT_EQ(error.context().file, path.string());
}

TEST(FileOutputTest, ReadingRefusesWhatIsTooLarge) {
  const fs::path path = scratch_folder() / "large";
  graspmap_test::write_text(path, "12345");
  EXPECT_EQ(libmap::read_whole_file(path, 5), "12345");
  const libmap::Error error = error_of([&] { libmap::read_whole_file(path, 4); });
  EXPECT_EQ(error.context().value, "5 bytes");
  EXPECT_EQ(error.context().bound, "<= 4");
}

TEST(FileOutputTest, WritingToNowhereFails) {
  const fs::path nowhere = scratch_folder() / "a" / "b";
  EXPECT_TRUE(is_error(error_of([&] { libmap::write_text(nowhere, "x"); }),
                       {.file = nowhere, .kind = ErrorKind::failed}));
}

}  // namespace file_output_test
