#include "libmap/refine/refinement_stages.h"

#include <gtest/gtest.h>

#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"

namespace refinement_stages_test {

using graspmap_test::beside;
using graspmap_test::TexturedScan;
using libmap::Pose;
using libmap::RefinementInput;
using libmap::RefinementState;
using libmap::StageResult;

libmap::PoseLink link_between(int from, int to, const Pose& from_from_to = Pose::Identity()) {
  return {from, to, libmap::LinkType::neighbor, from_from_to, 1e4 * libmap::Matrix6d::Identity()};
}

// Frames along a path in front of points, with pose errors of centimeters.
struct Way {
  TexturedScan scan{};  // without frames
  libmap::RefinementOptions options{};
  RefinementInput input{scan, options, libmap::no_progress()};
  RefinementState state{};

  Way() {
    constexpr int count = 6;
    const auto points = graspmap_test::random_points(150);
    std::vector<libmap::FrameFeatures> frames;
    for (int n = 1; n <= count; ++n) {
      frames.push_back(graspmap_test::see_points(n, beside(0.1 * n), points, {.apply = true}));
      state.poses[n] = n == 1
                           ? beside(0.1)
                           : libmap::moved(beside(0.1 * n), graspmap_test::random_step(0.02, 0.01));
      if (n > 1)
        state.other_links.push_back(
            {link_between(n - 1, n, state.poses.at(n - 1).inverse() * state.poses.at(n)), "odo"});
    }
    state.frames = state.stored_frames =
        std::make_shared<std::vector<libmap::FrameFeatures>>(std::move(frames));
    state.graph = libmap::graph_as_stored(input, state);
  }
};

double largest_error_m(const RefinementState& state) {
  double largest = 0.0;
  for (const auto& [node, pose] : state.poses)
    largest = std::max(largest, (pose.translation() - beside(0.1 * node).translation()).norm());
  return largest;
}

TEST(RefinementStages, ReturnTheNextStateAndLeaveTheirOwn) {
  const Way way;
  const RefinementState& state = way.state;
  const double error_m = largest_error_m(state);
  const StageResult linked =
      libmap::link_stage(way.input, state, 0, {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}});
  EXPECT_EQ(linked.report.name, "neighbors");
  EXPECT_EQ(linked.report.closures.accepted, 5U);
  EXPECT_EQ(linked.state.feature_links.size(), 5U);
  EXPECT_EQ(linked.state.graph.links.size(), 10U);
  EXPECT_TRUE(state.feature_links.empty());
  EXPECT_EQ(state.graph.links.size(), 5U);
  EXPECT_EQ(largest_error_m(state), error_m);
  const StageResult bundled = libmap::bundle_stage(way.input, linked.state);
  EXPECT_FALSE(bundled.report.rejected);
  EXPECT_LT(largest_error_m(bundled.state), 0.2 * error_m);
  EXPECT_TRUE(bundled.state.is_from_bundle);
  EXPECT_FALSE(linked.state.is_from_bundle);
  EXPECT_EQ(bundled.state.frames, state.frames) << "frames are shared";
}

TEST(RefinementStages, LinksThatTheGraphRejectsLeaveBothLists) {
  RefinementState state;
  state.other_links.resize(1);
  for (const int node : {1, 2, 3}) {
    libmap::FeatureLink link;
    link.link = link_between(node, node + 1);
    state.feature_links.push_back(link);
  }
  for (const bool rejected : {true, true, false, true})
    state.graph.links.push_back({.rejected = rejected});
  EXPECT_EQ(libmap::drop_rejected_links(state), 2U);
  ASSERT_EQ(state.feature_links.size(), 1U);
  EXPECT_EQ(state.feature_links.front().link.from, 2);
  ASSERT_EQ(state.graph.links.size(), 2U) << "rejected links of the scan itself are reported";
  EXPECT_TRUE(state.graph.links.front().rejected);
  EXPECT_FALSE(state.graph.links.back().rejected);
}

TEST(RefinementStages, AKnownScaleMovesPosesDepthAndLinksOfFeatures) {
  Way way;
  way.options.scale = 1.5;
  RefinementState& state = way.state;
  state.feature_links.resize(1);
  state.graph.links.push_back({.link = link_between(1, 2, beside(0.1))});
  const libmap::ScaleResult scaled = libmap::scale_stage(way.input, state, {}, {});
  EXPECT_EQ(scaled.sentence, "scale x 1.5 as given: corrected");
  ASSERT_TRUE(scaled.stage);
  const RefinementState& next = scaled.stage->state;
  const auto way_of = [](const RefinementState& of) {
    return Eigen::Vector3d(of.poses.at(4).translation() - of.poses.at(1).translation());
  };
  EXPECT_TRUE(way_of(next).isApprox(1.5 * way_of(state), 1e-12));
  EXPECT_TRUE(next.poses.at(1).isApprox(state.poses.at(1))) << "the gauge node stays";
  EXPECT_TRUE(next.graph.links.back().link.from_from_to.translation().isApprox(
      1.5 * beside(0.1).translation()));
  EXPECT_TRUE(next.graph.links.front().link.from_from_to.isApprox(
      state.graph.links.front().link.from_from_to));
  ASSERT_EQ(next.calibration.depth.size(), 1U);
  EXPECT_EQ(next.calibration.depth.front().scale, 1.5);
  way.options.scale = 1.0;
  EXPECT_FALSE(libmap::scale_stage(way.input, state, {}, {}).stage);
}

}  // namespace refinement_stages_test
