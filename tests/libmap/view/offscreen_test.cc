#include "libmap/view/offscreen.h"
#include <gtest/gtest.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vtkOutputWindow.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>

#include "libmap/view/scene_view.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace offscreen_test {

using graspmap_test::error_of;
using graspmap_test::is_error;

bool runs(int process) { return kill(process, 0) == 0; }

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "(unset)";
}

ColorImage small_image() {
  Scene scene;
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 1, 0}};
  scene.layers.push_back({.shape = cloud});
  SceneViewOptions options;
  options.width = options.height = 64;
  return render_scene(scene, options);
}

class VirtualDisplayTest : public ::testing::Test {
 protected:
  void SetUp() override { unsetenv("DISPLAY"); }
};

TEST_F(VirtualDisplayTest, StartsAServerAndEndsIt) {
  int process = 0;
  {
    const VirtualDisplay display;
    ASSERT_TRUE(display.started());
    process = display.process_id();
    EXPECT_TRUE(runs(process));
    EXPECT_EQ(variable("DISPLAY").front(), ':');
  }
  EXPECT_FALSE(runs(process));
  EXPECT_EQ(variable("DISPLAY"), "(unset)");
  EXPECT_EQ(variable("LIBGL_ALWAYS_SOFTWARE"), "(unset)");
}

TEST_F(VirtualDisplayTest, ADisplayThatAnswersIsUsed) {
  const VirtualDisplay outer;
  const std::string name = variable("DISPLAY");
  {
    const VirtualDisplay inner;
    EXPECT_FALSE(inner.started());
    EXPECT_EQ(variable("DISPLAY"), name);
    EXPECT_EQ(small_image().pixels.size(), 64U * 64);
  }
  EXPECT_EQ(variable("DISPLAY"), name);
  EXPECT_TRUE(runs(outer.process_id()));
}

TEST_F(VirtualDisplayTest, ADeadDisplayIsReplacedAndRestored) {
  setenv("DISPLAY", ":64999", 1);
  {
    const VirtualDisplay display;
    EXPECT_TRUE(display.started());
    EXPECT_NE(variable("DISPLAY"), ":64999");
  }
  EXPECT_EQ(variable("DISPLAY"), ":64999");
}

TEST_F(VirtualDisplayTest, DrawsOneAfterTheOtherWithServersOfTheirOwn) {
  const ColorImage first = small_image();
  EXPECT_EQ(small_image(), first);
  EXPECT_EQ(variable("DISPLAY"), "(unset)");
  // No child is left behind, neither running nor as a zombie; the thread sanitizer has one of its
  // own.
  if (!graspmap_test::has_thread_sanitizer) {
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
  }
}

TEST_F(VirtualDisplayTest, NamesThePackageThatIsMissing) {
  const std::string path = variable("PATH");
  setenv("PATH", "/nonexistent", 1);
  const Error error = error_of([] { const VirtualDisplay display; });
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.field = "program Xvfb", .kind = libmap::ErrorKind::failed}));
}

TEST_F(VirtualDisplayTest, AServerThatDoesNotComeUpIsAnError) {
  const auto folder = graspmap_test::scratch_folder();
  graspmap_test::write_text(folder / "Xvfb", "#!/bin/sh\nexit 1\n");
  std::filesystem::permissions(folder / "Xvfb", std::filesystem::perms::owner_all);
  const std::string path = variable("PATH");
  setenv("PATH", (folder.string() + ":" + path).c_str(), 1);
  const Error error = error_of([] { const VirtualDisplay display; });
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.field = "start of Xvfb", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(variable("DISPLAY"), "(unset)");
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
}

TEST_F(VirtualDisplayTest, AServerWithoutOpenGlIsAnError) {
  const auto folder = graspmap_test::scratch_folder();
  const std::string path = variable("PATH");
  graspmap_test::write_text(folder / "Xvfb",
                            "#!/bin/sh\nPATH='" + path + "'\nexec Xvfb \"$@\" -extension GLX\n");
  std::filesystem::permissions(folder / "Xvfb", std::filesystem::perms::owner_all);
  setenv("PATH", (folder.string() + ":" + path).c_str(), 1);
  const Error error = error_of([] { const VirtualDisplay display; });
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.field = "OpenGL", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(variable("DISPLAY"), "(unset)");
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
}

TEST_F(VirtualDisplayTest, WithoutAFileLeftToOpenItIsAnError) {
  const Error error = error_of([] {
    const graspmap_test::LowerLimit no_file(RLIMIT_NOFILE, 0);
    const VirtualDisplay display;
  });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.field = "pipe to Xvfb", .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(variable("LIBGL_ALWAYS_SOFTWARE"), "(unset)");
}

// A program that is killed cannot end its server: the server must notice.
TEST_F(VirtualDisplayTest, TheServerEndsWithAKilledProgram) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const pid_t program = fork();
  if (program == 0) {
    const VirtualDisplay display;
    const int process = display.process_id();
    if (write(pipe_ends[1], &process, sizeof(process)) < 0) _exit(1);
    pause();
    _exit(0);
  }
  int server = 0;
  ASSERT_EQ(read(pipe_ends[0], &server, sizeof(server)), static_cast<ssize_t>(sizeof(server)));
  close(pipe_ends[0]);
  close(pipe_ends[1]);
  ASSERT_GT(server, 0);
  EXPECT_TRUE(runs(server));
  kill(program, SIGKILL);
  waitpid(program, nullptr, 0);
  for (int wait = 0; wait < 1000 && runs(server); ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_FALSE(runs(server));
}

TEST(DrawOffscreen, WhatVtkSaysIsTheReason) {
  testing::internal::CaptureStderr();
  const Error error = error_of([] {
    draw_offscreen(20, 10, [](vtkRenderWindow&) {
      vtkOutputWindowDisplayErrorText("ERROR: no such shader\nat all\n");
      vtkOutputWindowDisplayErrorText("ERROR: a later one");
    });
  });
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(
      is_error(error, {.about = "no such shader at all", .kind = libmap::ErrorKind::failed}));
}

TEST(DrawOffscreen, AImageWithoutPixelsCannotBeReadBack) {
  const Error error = error_of([] { draw_offscreen(0, 0, [](vtkRenderWindow&) {}); });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.field = "OpenGL", .kind = libmap::ErrorKind::failed}));
}

}  // namespace offscreen_test
}  // namespace libmap
