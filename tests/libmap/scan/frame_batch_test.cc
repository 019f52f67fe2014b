#include "libmap/camera/rgbd_frame.h"

#include <gtest/gtest.h>

namespace frame_batch_test {

TEST(FrameBatch, FewerOfLargerFrames) {
  EXPECT_EQ(libmap::frames_in_batch(0), 8U);
  EXPECT_EQ(libmap::frames_in_batch(512 * 424), 8U);
  EXPECT_EQ(libmap::frames_in_batch(1920 * 1080), 8U);
  EXPECT_EQ(libmap::frames_in_batch(4096 * 3072), 1U);
  EXPECT_EQ(libmap::frames_in_batch(std::size_t{1} << 40), 1U);
}

TEST(FrameBatch, PixelsOfTheLargestImage) {
  libmap::RgbdFrame frame;
  EXPECT_EQ(libmap::image_pixels(frame), 0U);
  frame.depth = libmap::DepthImage(3, 2, 1.0F);
  EXPECT_EQ(libmap::image_pixels(frame), 6U);
  libmap::Camera camera;
  camera.width = 4;
  camera.height = 5;
  frame.cameras = {camera, camera};
  EXPECT_EQ(libmap::image_pixels(frame), 40U);
}

}  // namespace frame_batch_test
