// Features that several frames see: matches of pairs of frames with the motion that they agree on,
// and the tracks of points that matches form.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/features/relative_pose.h"

namespace libmap {

// How the features of two frames are matched.
struct MatchingOptions {
  double max_ratio = 0.8;  // > 0: of the descriptors' distances (match_features)
  int held_out = 10;       // >= 2: every so many features serve for checks alone
  RelativePoseOptions estimate{};
};

// Two frames, by their places in the list of frames; first < second.
using FramePair = std::pair<std::size_t, std::size_t>;

// One verified link between two frames.
struct FeatureLink {
  FramePair frames;
  PoseLink link{};                       // node to node
  std::vector<FeatureMatch> matches{};   // a in the link's `from`; those it was estimated from
  std::vector<FeatureMatch> held_out{};  // matches that fit and were not used
  double chi_square_per_freedom = 0.0;
};

// Why pairs of frames gave no link.
struct RejectionCounts {
  std::size_t candidates = 0;
  std::size_t too_few_matches = 0;
  std::size_t too_few_inliers = 0;
  std::size_t narrow = 0;  // inliers on one spot or line of the picture
  std::size_t not_converged = 0;
  std::size_t against_graph = 0;  // further from the graph's own estimate than it can be
  std::size_t unconfirmed = 0;    // between parts of the graph, without a second that agrees
  std::size_t accepted = 0;
};

struct PairVerification {
  std::vector<FeatureLink> links;  // in the order of the pairs
  RejectionCounts counts;
};

// Of pairs of frames whose descriptors have been compared: that does not depend on their cameras.
using KnownMatches = std::map<FramePair, std::vector<FeatureMatch>>;

// Matches the features of each pair and estimates its motion. The same for any number of threads.
// With `known`, matches of pairs that are not in it are added.
PairVerification verify_pairs(const std::vector<FrameFeatures>& frames,
                              const std::vector<FramePair>& pairs, const MatchingOptions& options,
                              std::uint64_t seed, Progress& progress = no_progress(),
                              KnownMatches* known = nullptr);

// The motion that some matches of a pair agree on, be they too few for a link: a guess.
std::optional<Pose> guess_motion(const std::vector<FrameFeatures>& frames, const FramePair& pair,
                                 const MatchingOptions& options, std::uint64_t seed);

struct Observation {
  std::uint32_t frame = 0;
  std::uint32_t feature = 0;
  bool operator==(const Observation&) const = default;
};

struct FeatureTrack {
  std::vector<Observation> observations;  // by ascending frame, each frame once
};

struct FeatureTracks {
  std::vector<FeatureTrack> tracks;  // of two observations or more
  std::size_t conflicts = 0;         // matches left out: they would show a point twice in a frame
  std::size_t split = 0;             // ... or join frames without a link
};

// linked: those of a track are linked with each other, each with each; a point that many frames see
// becomes several tracks. The system of such tracks is as sparse as the graph of the links, however
// often a place is visited.
enum class TrackFrames { any, linked };

// Joins matches into tracks (union-find), those first that fit best; a match that would join two
// features of one frame is left out.
FeatureTracks build_tracks(const std::vector<FrameFeatures>& frames,
                           const std::vector<FeatureLink>& links,
                           TrackFrames together = TrackFrames::any);

}  // namespace libmap
