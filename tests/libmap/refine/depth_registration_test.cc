#include "libmap/refine/depth_registration.h"

#include <gmock/gmock.h>

#include <numbers>

#include "libmap/camera/depth_correction.h"
#include "libmap/consistency/edge_agreement.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_registration_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::small_options;
using graspmap_test::textured_camera;
using graspmap_test::TexturedScan;
using ::testing::Contains;

// Depth as seen from elsewhere, with another focal length, stored as if it were registered.
TexturedScan displaced_scan(const Pose& color_from_depth, double focal_factor) {
  TexturedScan scan;
  for (int n = 0; n < 14; ++n) scan.see(boulders(), around(9.0 * n), Vector6d::Zero());
  Camera depth_camera = textured_camera();
  depth_camera.fx *= focal_factor;
  depth_camera.fy *= focal_factor;
  for (auto& [node, frame] : scan.frames)
    frame.depth =
        register_depth(frame.depth, textured_camera(), depth_camera, color_from_depth.inverse());
  return scan;
}

Pose displacement() {
  Pose pose = Pose::Identity();
  pose.linear() = rotation_of(Eigen::Vector3d(0, 1.5 * std::numbers::pi / 180.0, 0)).matrix();
  pose.translation() = Eigen::Vector3d(0.025, 0, 0);
  return pose;
}

TEST(DepthRegistration, GrossErrorsAreCorrected) {
  const TexturedScan scan = displaced_scan(displacement(), 1.0);
  const RefinementResult result = refine_poses(scan, small_options());
  EXPECT_THAT(result.warnings, Contains(register_coarsely(scan, true).finding));
  ASSERT_EQ(result.calibration.color_from_depth.size(), 1U);
  EXPECT_TRUE(is_near(result.calibration.color_from_depth.front(), displacement(), 0.004, 0.004));
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.002);
  EXPECT_TRUE(is_near(refined_camera(result, scan).color_from_depth,
                      result.calibration.color_from_depth.front(), 1e-12, 1e-12));
}

TEST(DepthRegistration, IsOnlyStatedWhereItIsNotWanted) {
  const TexturedScan scan = displaced_scan(displacement(), 1.0);
  const CoarseRegistration stated = register_coarsely(scan, false);
  EXPECT_NE(stated.finding, "");
  EXPECT_EQ(stated.scan, nullptr);
  EXPECT_TRUE(stated.color_from_depth.matrix().isIdentity(0.0));
  const TexturedScan right = displaced_scan(Pose::Identity(), 1.0);
  EXPECT_EQ(register_coarsely(right, true).finding, "");
  EXPECT_EQ(register_coarsely(right, true).scan, nullptr);
}

TEST(DepthRegistration, AnotherFocalLengthIsRefused) {
  const TexturedScan scan = displaced_scan(Pose::Identity(), 1.1);
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { register_coarsely(scan, true); }),
      {.field = "depth_calibration", .about = register_coarsely(scan, false).finding}));
  EXPECT_TRUE(check_edge_agreement(scan).is_scaled());
}

TEST(DepthRegistration, IsAddedBeforeThatOfTheRefinement) {
  SensorCalibration calibration;
  add_registration(Pose::Identity(), 1, calibration);
  EXPECT_TRUE(calibration.empty());
  add_registration(displacement(), 1, calibration);
  ASSERT_EQ(calibration.color_from_depth.size(), 1U);
  EXPECT_TRUE(is_near(calibration.color_from_depth.front(), displacement(), 1e-12, 1e-12));
  Pose fine = Pose::Identity();
  fine.linear() = rotation_of(Eigen::Vector3d(0.01, 0, 0.02)).matrix();
  fine.translation() = Eigen::Vector3d(0, 0.002, 0.001);
  calibration.color_from_depth = {fine};
  add_registration(displacement(), 1, calibration);
  EXPECT_TRUE(is_near(calibration.color_from_depth.front(), fine * displacement(), 1e-12, 1e-12));
}

}  // namespace depth_registration_test
}  // namespace libmap
