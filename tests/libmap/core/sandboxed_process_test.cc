#include "libmap/core/sandboxed_process.h"

#include <gtest/gtest.h>

#include <csignal>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/lower_limit.h"
#include "tests/support/test_support.h"

namespace sandboxed_process_test {

using libmap::SandboxedProcess;

constexpr std::uint64_t memory = std::uint64_t{1} << 30;

TEST(SandboxedProcess, WhatItWritesIsRead) {
  const std::string text(1 << 20, 'x');  // more than the buffer of a pipe
  SandboxedProcess process(memory, [&](const SandboxedProcess::Write& write) {
    write(text);
    write("end");
  });
  std::string read(text.size() + 3, '\0');
  ASSERT_TRUE(process.read(read.data(), read.size()));
  EXPECT_EQ(read, text + "end");
  EXPECT_FALSE(process.read(read.data(), 1));
  EXPECT_EQ(process.end(), "");
}

TEST(SandboxedProcess, ItsFallIsNotOurs) {
  SandboxedProcess killed(memory, [](const SandboxedProcess::Write& write) {
    write("ab");
    raise(SIGKILL);
  });
  std::string read(3, '\0');
  EXPECT_FALSE(killed.read(read.data(), 3));
  EXPECT_EQ(killed.end(), " (signal 9)");
  SandboxedProcess thrown(memory,
                          [](const SandboxedProcess::Write&) { throw std::logic_error("x"); });
  EXPECT_FALSE(thrown.read(read.data(), 1));
  EXPECT_EQ(thrown.end(), "");
}

TEST(SandboxedProcess, EndsWithItsReader) {
  const SandboxedProcess process(memory, [](const SandboxedProcess::Write& write) {
    while (true) write("for ever");
  });
}

TEST(SandboxedProcess, NoneWithoutFiles) {
  const libmap::Error error = graspmap_test::error_of([] {
    const graspmap_test::LowerLimit no_file(RLIMIT_NOFILE, 0);
    const SandboxedProcess process(memory, [](const SandboxedProcess::Write&) {});
  });
  EXPECT_TRUE(graspmap_test::is_error(
      error, {.field = "start of a child process", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
}

}  // namespace sandboxed_process_test
