#include "libmap/view/offscreen.h"

#include <gtest/gtest.h>
#include <vtkOutputWindow.h>

#include "tests/support/test_support.h"

namespace libmap {
namespace offscreen_test {

using graspmap_test::error_of;

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
  EXPECT_STREQ(error.what(), "VTK could not draw the picture: ERROR: no such shader at all");
}

TEST(DrawOffscreen, APictureWithoutPixelsCannotBeReadBack) {
  const Error error = error_of([] { draw_offscreen(0, 0, [](vtkRenderWindow&) {}); });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_STREQ(error.what(), "the picture could not be read back from OpenGL");
}

}  // namespace offscreen_test
}  // namespace libmap
