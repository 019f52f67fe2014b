#include "libmap/core/guarded_process.h"

#include <gtest/gtest.h>

#include <csignal>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/lower_limit.h"
#include "tests/support/test_support.h"

namespace guarded_process_test {

using libmap::GuardedProcess;

constexpr std::uint64_t memory = std::uint64_t{1} << 30;

TEST(GuardedProcess, WhatItWritesIsRead) {
  const std::string text(1 << 20, 'x');  // more than the buffer of a pipe
  GuardedProcess process(memory, [&](const GuardedProcess::Write& write) {
    write(text);
    write("end");
  });
  std::string read(text.size() + 3, '\0');
  ASSERT_TRUE(process.read(read.data(), read.size()));
  EXPECT_EQ(read, text + "end");
  EXPECT_FALSE(process.read(read.data(), 1));
  EXPECT_EQ(process.end(), "");
}

TEST(GuardedProcess, ItsFallIsNotOurs) {
  GuardedProcess killed(memory, [](const GuardedProcess::Write& write) {
    write("ab");
    raise(SIGKILL);
  });
  std::string read(3, '\0');
  EXPECT_FALSE(killed.read(read.data(), 3));
  EXPECT_EQ(killed.end(), " (signal 9)");
  GuardedProcess thrown(memory, [](const GuardedProcess::Write&) { throw std::logic_error("x"); });
  EXPECT_FALSE(thrown.read(read.data(), 1));
  EXPECT_EQ(thrown.end(), "");
}

TEST(GuardedProcess, EndsWithItsReader) {
  const GuardedProcess process(memory, [](const GuardedProcess::Write& write) {
    while (true) write("for ever");
  });
}

TEST(GuardedProcess, NoneWithoutFiles) {
  const libmap::Error error = graspmap_test::error_of([] {
    const graspmap_test::LowerLimit no_file(RLIMIT_NOFILE, 0);
    const GuardedProcess process(memory, [](const GuardedProcess::Write&) {});
  });
  EXPECT_TRUE(
      graspmap_test::is_error(error, {.about = "child", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
}

}  // namespace guarded_process_test
