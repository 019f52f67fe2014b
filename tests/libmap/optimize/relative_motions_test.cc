#include "libmap/optimize/relative_motions.h"

#include <gtest/gtest.h>

namespace relative_motions_test {

using libmap::FrameFeatures;
using libmap::KnownMotion;
using libmap::Pose;
using libmap::Vector6d;

struct Path {
  std::vector<FrameFeatures> frames;
  std::map<int, Pose> poses;

  void add(double stamp_s, const Pose& pose) {
    frames.emplace_back();
    frames.back().node = static_cast<int>(frames.size());
    frames.back().stamp_s = stamp_s;
    poses[frames.back().node] = pose;
  }
};

Vector6d some_motion() { return (Vector6d() << 0.3, -0.1, 0.05, 0.2, -0.3, 0.1).finished(); }

TEST(RelativeMotions, ASteadyMotionIsFound) {
  Path path;
  Pose pose = libmap::moved(Pose::Identity(), some_motion());
  for (int n = 0; n < 4; ++n) {
    path.add(2.0 + 0.5 * n, pose);
    pose = libmap::moved(pose, 0.5 * some_motion());
  }
  const auto motions = libmap::relative_motions(path.frames, path.poses, {});
  ASSERT_EQ(motions.size(), 4U);
  for (const auto& [node, motion] : motions) {
    // Accurate to first order in the rotation of half a second; one-sided at the ends.
    EXPECT_LT((motion.mean - some_motion()).norm(), 0.05) << node;
    EXPECT_EQ(motion.deviation, KnownMotion{}.deviation) << "poses that far apart";
  }
}

// For five closely following poses, the derivative of a polynomial of fourth order. The deviation
// is smaller over a shorter time.
TEST(RelativeMotions, AnAcceleratedMotionIsFoundByClosePoses) {
  Path path;
  for (int n = -2; n <= 2; ++n) {
    const double time_s = 0.1 * n;
    path.add(time_s,
             Pose(Eigen::Translation3d(
                 0.4 * time_s + 3.0 * std::pow(time_s, 2) - 5.0 * std::pow(time_s, 3), 0.0, 0.0)));
  }
  const KnownMotion motion = libmap::relative_motions(path.frames, path.poses, {}).at(3);
  EXPECT_NEAR(motion.mean.x(), 0.4, 1e-9);
  EXPECT_LT(motion.mean.tail<5>().norm(), 1e-12);
  EXPECT_LT(motion.deviation.x(), 0.7 * KnownMotion{}.deviation.x());
}

TEST(RelativeMotions, GapsAndOtherComponentsTellNothing) {
  Path path;
  for (const double stamp_s : {0.0, 0.5, 10.0, 10.4})
    path.add(stamp_s, Pose(Eigen::Translation3d(stamp_s, 0.0, 0.0)));
  auto motions = libmap::relative_motions(path.frames, path.poses, {});
  EXPECT_NEAR(motions.at(2).mean.x(), 1.0, 1e-12) << "from the one side only";
  EXPECT_NEAR(motions.at(3).mean.x(), 1.0, 1e-12);
  motions = libmap::relative_motions(path.frames, path.poses, {{{1, 3, 4}, 1}, {{2}, 2}});
  EXPECT_EQ(motions.size(), 4U);
  EXPECT_EQ(motions.at(1).mean, Vector6d::Zero());
  EXPECT_EQ(motions.at(2).mean, Vector6d::Zero());
  EXPECT_NEAR(motions.at(4).mean.x(), 1.0, 1e-12);
  path.poses.erase(4);
  EXPECT_FALSE(libmap::relative_motions(path.frames, path.poses, {}).contains(4));
}

}  // namespace relative_motions_test
