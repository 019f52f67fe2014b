#include "libmap/core/file_output.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "libmap/core/error.h"
#include "tests/support/file_names.h"
#include "tests/support/test_support.h"

namespace unfinished_outputs_test {

namespace fs = std::filesystem;
using graspmap_test::names_in;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using libmap::OutputFile;
using libmap::OutputFolder;

// Runs `action` in a child process, because abandoning outputs is final.
template <typename Action>
void in_a_process(const Action& action) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    action();
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

class UnfinishedOutputs : public testing::Test {
 protected:
  fs::path folder_ = scratch_folder();  // computed once: a child process would get another folder
};

TEST_F(UnfinishedOutputs, AbandonedOnesLeaveNothing) {
  libmap::write_whole_file(folder_ / "map.csv", "earlier");
  in_a_process([&] {
    const OutputFile file(folder_ / "map.csv");
    OutputFile moved_from(folder_ / "map.pcd");
    const OutputFile moved(std::move(moved_from));
    const OutputFolder folder(folder_ / "frames", {"rgb"});
    fs::create_directory(folder.temporary_path() / "rgb");
    libmap::write_text(folder.temporary_path() / "rgb/1.png", "picture");
    OutputFile done(folder_ / "done.csv");
    libmap::write_text(done.temporary_path(), "whole");
    done.commit();
    libmap::abandon_unfinished_outputs();
    _exit(0);
  });
  EXPECT_EQ(names_in(folder_), (std::vector<std::string>{"done.csv", "map.csv"}));
  EXPECT_EQ(read_text(folder_ / "map.csv"), "earlier");
}

TEST_F(UnfinishedOutputs, AFolderThatIsBeingFilledGoesToo) {
  in_a_process([&] {
    const OutputFolder folder(folder_ / "frames", {"rgb"});
    std::atomic<int> written = 0;
    std::thread([&] {
      for (;; ++written)
        std::ofstream(folder.temporary_path() / std::to_string(written)) << "picture";
    }).detach();
    while (written < 100) std::this_thread::yield();
    libmap::abandon_unfinished_outputs();
    _exit(0);
  });
  EXPECT_EQ(names_in(folder_), std::vector<std::string>{});
}

TEST_F(UnfinishedOutputs, NothingIsPutInPlaceAfterwards) {
  in_a_process([&] {
    OutputFile file(folder_ / "map.csv");
    libmap::write_text(file.temporary_path(), "half");
    libmap::abandon_unfinished_outputs();
    std::atomic<bool> has_gone_on = false;
    std::thread([&] {
      try {
        file.commit();
      } catch (const libmap::Error&) {
        // The file to sync is gone.
        const OutputFile next(folder_ / "next.csv");
      }
      has_gone_on = true;
    }).detach();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    _exit(has_gone_on ? 1 : 0);
  });
  EXPECT_EQ(names_in(folder_), std::vector<std::string>{});
}

TEST_F(UnfinishedOutputs, WhatIsPutInPlaceAsOneStepComesAsAWhole) {
  in_a_process([&] {
    std::vector<OutputFile> outputs;
    for (const char* name : {"a.csv", "b.csv"}) {
      outputs.emplace_back(folder_ / name);
      libmap::write_text(outputs.back().temporary_path(), name);
    }
    std::atomic<bool> is_in_step = false;
    std::thread([&] {
      const libmap::CommitGuard guard;
      is_in_step = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      libmap::commit_together(outputs);
    }).detach();
    while (!is_in_step) std::this_thread::yield();
    libmap::abandon_unfinished_outputs();
    _exit(0);
  });
  EXPECT_EQ(names_in(folder_), (std::vector<std::string>{"a.csv", "b.csv"}));
}

}  // namespace unfinished_outputs_test
