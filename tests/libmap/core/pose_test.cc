#include "libmap/core/pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "tests/support/test_support.h"

namespace pose_test {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using graspmap_test::uniform;
using libmap::Pose;

Vector3d random_vector(double size) {
  return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
}

Matrix3d random_rotation() {
  return Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))
      .normalized()
      .toRotationMatrix();
}

TEST(PoseTest, QuaternionOfAnyLength) {
  const double half = std::numbers::pi / 4;
  const Quaterniond quarter_turn_z(7 * std::cos(half), 0, 0, 7 * std::sin(half));
  const Pose pose = libmap::make_pose({1, 2, 3}, quarter_turn_z);
  EXPECT_TRUE((pose * Vector3d::UnitX()).isApprox(Vector3d(1, 3, 3), 1e-12));
  EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-12);
}

TEST(PoseTest, RollPitchYawTurnAboutTheFixedAxes) {
  const auto turned = [](const Vector3d& rpy_deg, const Vector3d& point) -> Vector3d {
    return libmap::make_pose_from_rpy(Vector3d::Zero(), rpy_deg) * point;
  };
  EXPECT_TRUE(turned({90, 0, 0}, Vector3d::UnitY()).isApprox(Vector3d::UnitZ(), 1e-12));
  EXPECT_TRUE(turned({0, 90, 0}, Vector3d::UnitZ()).isApprox(Vector3d::UnitX(), 1e-12));
  EXPECT_TRUE(turned({0, 0, 90}, Vector3d::UnitX()).isApprox(Vector3d::UnitY(), 1e-12));
  // First roll (y to z), then pitch (z to x), then yaw (x to y).
  EXPECT_TRUE(turned({90, 90, 90}, Vector3d::UnitY()).isApprox(Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE(turned({90, 90, 90}, Vector3d::UnitX()).isApprox(-Vector3d::UnitZ(), 1e-12));
}

TEST(PoseTest, RollPitchYawIsTheProductOfThreeTurns) {
  for (int round = 0; round < 100; ++round) {
    const Vector3d rpy = random_vector(180);
    const Vector3d translation = random_vector(10);
    const double r = rpy.x() * std::numbers::pi / 180;
    const double p = rpy.y() * std::numbers::pi / 180;
    const double y = rpy.z() * std::numbers::pi / 180;
    Matrix3d roll, pitch, yaw;
    roll << 1, 0, 0, 0, std::cos(r), -std::sin(r), 0, std::sin(r), std::cos(r);
    pitch << std::cos(p), 0, std::sin(p), 0, 1, 0, -std::sin(p), 0, std::cos(p);
    yaw << std::cos(y), -std::sin(y), 0, std::sin(y), std::cos(y), 0, 0, 0, 1;
    const Pose pose = libmap::make_pose_from_rpy(translation, rpy);
    EXPECT_TRUE(pose.linear().isApprox(yaw * pitch * roll, 1e-12));
    EXPECT_EQ(pose.translation(), translation);
  }
}

TEST(PoseTest, NearestRotationKeepsARotation) {
  for (int round = 0; round < 100; ++round) {
    const Matrix3d rotation = random_rotation();
    EXPECT_TRUE(libmap::nearest_rotation(rotation).isApprox(rotation, 1e-12));
  }
}

TEST(PoseTest, NearestRotationIsProperAndNoOtherIsNearer) {
  for (int round = 0; round < 200; ++round) {
    Matrix3d matrix;
    for (int row = 0; row < 3; ++row) matrix.row(row) = random_vector(1).transpose();
    const Matrix3d nearest = libmap::nearest_rotation(matrix);
    ASSERT_TRUE((nearest * nearest.transpose()).isApprox(Matrix3d::Identity(), 1e-9));
    ASSERT_NEAR(nearest.determinant(), 1.0, 1e-9);
    const double distance = (nearest - matrix).norm();
    for (int other = 0; other < 20; ++other) {
      const Eigen::AngleAxisd nudge(uniform(-1, 1), random_vector(1).normalized());
      EXPECT_GE((nudge.toRotationMatrix() * nearest - matrix).norm(), distance - 1e-9);
    }
  }
}

TEST(PoseTest, NearestRotationOfAMirrorIsNoMirror) {
  const Matrix3d mirror = Vector3d(1, 1, -1).asDiagonal();
  EXPECT_NEAR(libmap::nearest_rotation(mirror).determinant(), 1.0, 1e-12);
  EXPECT_NEAR(libmap::nearest_rotation(Matrix3d::Zero()).determinant(), 1.0, 1e-12);
}

TEST(PoseTest, RollPitchYawOfAPose) {
  for (int i = 0; i < 50; ++i) {
    const Vector3d angles(uniform(-179, 179), uniform(-89, 89), uniform(-179, 179));
    const Pose pose = libmap::make_pose_from_rpy(Vector3d(1, 2, 3), angles);
    EXPECT_TRUE(libmap::roll_pitch_yaw_deg(pose).isApprox(angles, 1e-11));
  }
}

// At a pitch of +-90 degrees, only the combination of roll and yaw is determined.
TEST(PoseTest, RollPitchYawGiveTheRotationBackEverywhere) {
  for (const double pitch : {90.0, -90.0, 90.0 - 1e-7, 1e-9 - 90.0, 89.99}) {
    const Pose pose = libmap::make_pose_from_rpy(Vector3d::Zero(), {20, pitch, -140});
    const Vector3d angles = libmap::roll_pitch_yaw_deg(pose);
    EXPECT_NEAR(angles.y(), pitch, 1e-5);
    EXPECT_LT(
        (libmap::make_pose_from_rpy(Vector3d::Zero(), angles).matrix() - pose.matrix()).norm(),
        1e-14);
  }
}

}  // namespace pose_test
