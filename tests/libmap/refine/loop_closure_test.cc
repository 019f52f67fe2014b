#include "libmap/refine/loop_closure.h"

#include <gtest/gtest.h>

#include "tests/libmap/features/synthetic_features.h"

namespace loop_closure_test {

using graspmap_test::random_points;
using graspmap_test::random_step;
using graspmap_test::see_points;
using libmap::FrameFeatures;
using libmap::Pose;

Pose some_motion() { return libmap::moved(Pose::Identity(), random_step(0.3, 0.2)); }

// Matches of descriptors do not depend on the cameras and are not computed again.
TEST(VerifyPairs, KnownMatchesStandForDescriptors) {
  const auto points = random_points(80);
  std::vector<FrameFeatures> frames = {see_points(1, Pose::Identity(), points),
                                       see_points(2, some_motion(), points)};
  const auto links = [&](libmap::KnownMatches* known) {
    return libmap::verify_pairs(frames, {{0, 1}}, {}, 1, libmap::no_progress(), known).links;
  };
  const auto expected = links(nullptr);
  ASSERT_EQ(expected.size(), 1U);
  libmap::KnownMatches known;
  for (int time = 0; time < 2; ++time) {
    const auto found = links(&known);
    ASSERT_EQ(found.size(), 1U) << time;
    EXPECT_EQ(found[0].matches, expected[0].matches);
    EXPECT_EQ(found[0].held_out, expected[0].held_out);
    EXPECT_EQ(found[0].link.from_from_to.matrix(), expected[0].link.from_from_to.matrix());
    for (FrameFeatures& frame : frames)
      std::fill(frame.descriptors.begin(), frame.descriptors.end(), 1);
  }
  EXPECT_TRUE(links(nullptr).empty()) << "descriptors that say nothing";
}

// Ten matches are too few for a link, but enough for an initial motion.
TEST(GuessMotion, TakesFewMatches) {
  const auto points = random_points(10);
  const Pose truth = graspmap_test::beside(0.0).inverse() * graspmap_test::beside(0.1);
  const std::vector<FrameFeatures> frames = {see_points(1, graspmap_test::beside(0.0), points),
                                             see_points(2, graspmap_test::beside(0.1), points)};
  EXPECT_TRUE(libmap::verify_pairs(frames, {{0, 1}}, {}, 1).links.empty());
  const auto guess = libmap::guess_motion(frames, {0, 1}, {}, 1);
  ASSERT_TRUE(guess);
  EXPECT_LT(libmap::step_between(truth, *guess).norm(), 1e-3);
  const std::vector<FrameFeatures> blank = {frames[0], see_points(2, truth, {})};
  EXPECT_FALSE(libmap::guess_motion(blank, {0, 1}, {}, 1));
}

}  // namespace loop_closure_test
