#include "libmap/consistency/pose_consistency.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace pose_consistency_test {

using graspmap_test::box;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using ::testing::HasSubstr;

MemoryScan rocky_scan() {
  const auto ground =
      nearest_of({plane_z(0), sphere({0.3, 0.1, 0.05}, 0.3), sphere({-0.4, 0.3, 0.0}, 0.25),
                  box({-0.3, -0.5, 0}, {0.1, -0.2, 0.3})});
  MemoryScan scan;
  for (int n = 0; n < 10; ++n) {
    const double angle = 0.25 * n;
    scan.see(ground,
             looking({1.2 * std::cos(angle), 1.2 * std::sin(angle), 0.8 + 0.02 * n},
                     {0, 0.02 * n, 0.05}),
             small_camera(), {0.002, 0.002}, random_engine());
  }
  return scan;
}

template <typename Change>
PoseConsistency checked(const MemoryScan& scan, const Change& change) {
  Trajectory poses = scan.poses;
  for (TrajectoryPose& pose : poses) pose.world_from_base = change(pose.world_from_base);
  return check_pose_consistency(scan, poses);
}

TEST(PoseConsistency, RightPosesAgree) {
  const MemoryScan scan = rocky_scan();
  const PoseConsistency found = check_pose_consistency(scan, scan.poses);
  EXPECT_EQ(found.pairs, 9U);
  EXPECT_GT(found.given.measurements, 5000U);
  EXPECT_LT(found.given.contradicted, 0.2);
  EXPECT_LT(found.given.difference, 0.01);
  EXPECT_EQ(found.warning(), "");
  // The frame of the world does not matter.
  const Pose turned = make_pose_from_rpy({10, -20, 5}, {90, 10, 45});
  EXPECT_EQ(checked(scan, [&](const Pose& pose) { return turned * pose; }).warning(), "");
}

TEST(PoseConsistency, OtherConventionsAreNamed) {
  const MemoryScan scan = rocky_scan();
  const Pose base_from_camera = small_camera().base_from_camera;
  const auto expect_named = [&](const char* text, const auto& change) {
    const PoseConsistency found = checked(scan, change);
    EXPECT_THAT(found.convention, HasSubstr(text)) << found.warning();
    EXPECT_GT(found.given.contradicted, 0.4) << text;
    EXPECT_LT(found.best.contradicted, 0.2) << text;
    EXPECT_FALSE(found.warning().empty());
  };
  expect_named("--poses-quaternion wxyz", [](const Pose& pose) {
    const Eigen::Quaterniond q(pose.linear());
    Pose wrong = pose;
    wrong.linear() = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
    return wrong;
  });
  expect_named("--poses-of camera", [&](const Pose& pose) { return pose * base_from_camera; });
  expect_named("y up", [&](const Pose& pose) {
    return pose * base_from_camera *
           Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  });
  expect_named("inverted", [](const Pose& pose) { return pose.inverse(); });
  expect_named("changed to x -z y", [](const Pose& pose) {
    Pose wrong = pose;
    const Eigen::Vector3d p = pose.translation();
    wrong.translation() = Eigen::Vector3d(p.x(), p.z(), -p.y());
    return wrong;
  });
  expect_named("--poses-scale 0.001", [](const Pose& pose) {
    Pose wrong = pose;
    wrong.translation() *= 1000.0;
    return wrong;
  });
}

TEST(PoseConsistency, DepthInAnotherUnit) {
  MemoryScan scan = rocky_scan();
  for (auto& [node, frame] : scan.frames)
    for (float& z : frame.depth.pixels) z *= 0.2F;
  EXPECT_THAT(check_pose_consistency(scan, scan.poses).convention, HasSubstr("depth times 5"));
}

TEST(PoseConsistency, WrongPosesThatNoConventionExplains) {
  MemoryScan scan = rocky_scan();
  Trajectory poses = scan.poses;
  for (std::size_t n = 0; n < poses.size(); ++n)
    poses[n].world_from_base = scan.poses[(7 * n + 3) % poses.size()].world_from_base;
  const PoseConsistency found = check_pose_consistency(scan, poses);
  EXPECT_GT(found.given.contradicted, 0.5);
  EXPECT_EQ(found.convention, "");
  EXPECT_NE(found.warning(), "");
}

TEST(PoseConsistency, NothingToCompare) {
  MemoryScan scan = rocky_scan();
  EXPECT_EQ(check_pose_consistency(scan, {}).warning(), "");
  EXPECT_EQ(check_pose_consistency(scan, {scan.poses[0]}).warning(), "");
  for (auto& [node, frame] : scan.frames) scan.broken[node] = true;
  EXPECT_EQ(check_pose_consistency(scan, scan.poses).pairs, 0U);
}

}  // namespace pose_consistency_test
}  // namespace libmap
