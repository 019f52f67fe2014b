#include "libmap/features/feature_tracks.h"

#include <gtest/gtest.h>

#include "tests/libmap/features/synthetic_features.h"

namespace feature_tracks_test {

using graspmap_test::random_points;
using graspmap_test::random_step;
using graspmap_test::same_numbers;
using graspmap_test::see_points;
using libmap::FrameFeatures;
using libmap::Pose;

Pose some_motion() { return libmap::moved(Pose::Identity(), random_step(0.3, 0.2)); }

TEST(FeatureTracks, JoinsMatchesAndLeavesConflictsOut) {
  const auto points = random_points(30);
  std::vector<FrameFeatures> frames;
  for (int node = 1; node <= 3; ++node) frames.push_back(see_points(node, some_motion(), points));
  const auto linked = [&](std::size_t a, std::size_t b) {
    libmap::FeatureLink link;
    link.frames = {a, b};
    link.link.from_from_to = Pose::Identity();
    link.matches = same_numbers(30);
    return link;
  };
  std::vector<libmap::FeatureLink> links = {linked(0, 1), linked(1, 2)};
  // The first and the last frame are not linked, so no track joins them.
  const libmap::FeatureTracks apart =
      libmap::build_tracks(frames, links, libmap::TrackFrames::linked);
  EXPECT_EQ(apart.tracks.size(), 30U);
  EXPECT_EQ(apart.split, 30U);
  for (const auto& track : apart.tracks) EXPECT_EQ(track.observations.size(), 2U);
  libmap::FeatureTracks tracks = libmap::build_tracks(frames, links);
  ASSERT_EQ(tracks.tracks.size(), 30U);
  EXPECT_EQ(tracks.conflicts, 0U);
  for (const auto& track : tracks.tracks) EXPECT_EQ(track.observations.size(), 3U);
  links.push_back(linked(0, 2));
  links.back().matches = {{4, 5}};
  EXPECT_GE(libmap::build_tracks(frames, links).conflicts, 1U);
}

}  // namespace feature_tracks_test
