#include "libmap/optimize/icp_pairs.h"

#include <gtest/gtest.h>

#include "libmap/core/parallel.h"
#include "tests/libmap/refine/textured_scan.h"

namespace icp_pairs_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::looking;
using graspmap_test::TexturedScan;
using libmap::FrameFeatures;
using libmap::FramePair;
using libmap::IcpOptions;
using libmap::Pose;
using libmap::Vector6d;
using Pairs = std::vector<FramePair>;

TEST(IcpPairs, LinkedFramesOnce) {
  std::vector<FrameFeatures> frames(4);
  std::map<int, Pose> poses;
  for (int n = 0; n < 4; ++n) {
    frames[static_cast<std::size_t>(n)].node = 10 * (n + 1);
    if (n != 3) poses[10 * (n + 1)] = Pose::Identity();
  }
  const auto link = [](int from, int to) {
    libmap::PoseLink made;
    made.from = from;
    made.to = to;
    return made;
  };
  EXPECT_EQ(libmap::linked_pairs(frames, poses,
                                 {link(30, 20), link(20, 10), link(20, 30), link(10, 10),
                                  link(10, 40), link(10, 50)}),
            (Pairs{{0, 1}, {1, 2}}))
      << "a frame without a pose, one that there is not, and itself are left out";
}

struct Frames {
  std::vector<FrameFeatures> frames;
  std::map<int, Pose> poses;
  std::vector<libmap::GraphComponent> components{{{}, 1}};
};

// Three frames around boulders; the last has another view direction.
Frames four_frames() {
  TexturedScan scan;
  Frames all;
  for (const Pose& pose :
       {around(0), around(6), around(14), looking({0.6, 0.0, 1.1}, {3.0, 0.0, 0.0})}) {
    scan.see(boulders(), pose, Vector6d::Zero(), false);
    const int node = static_cast<int>(scan.frames.size());
    all.poses[node] = pose;
    all.components[0].nodes.push_back(node);
  }
  all.frames = libmap::find_features(scan, {1, 2, 3, 4}).frames;
  return all;
}

TEST(IcpPairs, FramesThatOverlap) {
  Frames all = four_frames();
  IcpOptions options;
  const auto pairs = [&] {
    return libmap::overlapping_pairs(all.frames, all.poses, all.components, options);
  };
  const Pairs expected = {{0, 1}, {0, 2}, {1, 2}};
  for (const unsigned threads : {1U, 3U}) {
    const libmap::ThreadLimit limit(threads);
    EXPECT_EQ(pairs(), expected);
  }
  options.pairs_per_frame = 1;  // only the frame with the largest overlap
  EXPECT_EQ(pairs(), (Pairs{{0, 1}, {1, 2}}));
  options.min_overlap = 1.0;
  EXPECT_TRUE(pairs().empty());
  options = {};
  all.components = {{{1, 2}, 1}, {{3, 4}, 3}};
  EXPECT_EQ(pairs(), (Pairs{{0, 1}})) << "poses of two components are not in one frame";
  all.components = {{{1, 2, 3, 4}, 1}};
  all.poses.erase(1);
  EXPECT_EQ(pairs(), (Pairs{{1, 2}}));
  all.poses.clear();
  EXPECT_TRUE(pairs().empty());
}

}  // namespace icp_pairs_test
