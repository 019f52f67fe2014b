#include "libmap/camera/depth_correction.h"

#include <gtest/gtest.h>

namespace depth_registration_test {

using libmap::Pose;

libmap::Camera camera_of(int width, int height) {
  return {.width = width,
          .height = height,
          .fx = 50.0,
          .fy = 50.0,
          .cx = 0.5 * (width - 1),
          .cy = 0.5 * (height - 1)};
}

// A wall at 2 m with a board at 1 m before its right half, seen from 10 cm to the left: the board's
// edge moves by 5 px, that of the wall by 2.5 px.
TEST(DepthRegistration, HasAShadow) {
  const libmap::Camera camera = camera_of(64, 48);
  libmap::DepthImage depth(64, 48, 2.0F);
  for (int y = 0; y < 48; ++y)
    for (int x = 32; x < 64; ++x) depth.at(x, y) = 1.0F;
  Pose color_from_depth = Pose::Identity();
  color_from_depth.translation() = Eigen::Vector3d(0.1, 0.0, 0.02);
  const libmap::DepthImage seen = libmap::register_depth(depth, camera, camera, color_from_depth);
  EXPECT_FLOAT_EQ(seen.at(50, 20), 1.02F);
  EXPECT_FLOAT_EQ(seen.at(10, 20), 2.02F);
  // 31.5 px is where the board begins: at (0.5 / 50 + 0.1) / 1.02 * 50 px from the middle.
  EXPECT_EQ(seen.at(35, 20), 0.0F) << "between the wall's end at 33.97 and the board's at 36.4";
  EXPECT_EQ(seen.at(36, 20), 0.0F);
  EXPECT_FLOAT_EQ(seen.at(37, 20), 1.02F);
  EXPECT_FLOAT_EQ(seen.at(33, 20), 2.02F);
  // From the other side the board hides the wall.
  color_from_depth.translation() = Eigen::Vector3d(-0.1, 0.0, 0.0);
  const libmap::DepthImage hidden = libmap::register_depth(depth, camera, camera, color_from_depth);
  EXPECT_FLOAT_EQ(hidden.at(26, 20), 2.0F);
  EXPECT_FLOAT_EQ(hidden.at(27, 20), 1.0F);
}

}  // namespace depth_registration_test
