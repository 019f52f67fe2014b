// Finds feature matches between pairs of frames, which are verified by a rigid motion, and joins
// the matches into tracks. A track contains the observations of one point in several frames.
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

// Options for matching the features of two frames.
struct MatchingOptions {
  double max_ratio = 0.8;  // > 0: maximum distance ratio of nearest to second nearest descriptor
  int held_out = 10;       // >= 2: one in this many features is used for evaluation only
  RelativePoseOptions estimate{};  // relative pose of the frames
};

// Indices of two frames in the list of frames; first < second.
using FramePair = std::pair<std::size_t, std::size_t>;

// One verified link between two frames.
struct FeatureLink {
  FramePair frames;
  PoseLink link{};                       // between the nodes of the frames
  std::vector<FeatureMatch> matches{};   // inliers; a is in frames.first, b in frames.second
  std::vector<FeatureMatch> held_out{};  // held-out matches with chi-square <= 4 * max_chi_square
  double chi_square_per_freedom = 0.0;   // chi-square of the inliers per degree of freedom
};

// Number of pairs of frames by outcome.
struct RejectionCounts {
  std::size_t candidates = 0;  // all pairs
  std::size_t too_few_matches = 0;
  std::size_t too_few_inliers = 0;
  std::size_t degenerate = 0;  // inliers in one spot or on one line of the image
  std::size_t not_converged = 0;
  std::size_t against_graph = 0;  // not consistent with the pose graph's estimate and covariance
  std::size_t unconfirmed = 0;    // no other link between the same two graph components agrees
  std::size_t accepted = 0;
};

struct PairVerification {
  std::vector<FeatureLink> links;  // in the order of the pairs
  RejectionCounts counts;
};

// Matches by pair of frames. Matches depend on the descriptors, not on the camera calibration.
using KnownMatches = std::map<FramePair, std::vector<FeatureMatch>>;

// Matches the features of each pair and estimates the relative pose; a pair without a valid
// estimate has no link. For pairs in `known`, the known matches are used; the matches of the other
// pairs are added to `known`. Throws Error if a descriptor file cannot be read.
PairVerification verify_pairs(const std::vector<FrameFeatures>& frames,
                              const std::vector<FramePair>& pairs, const MatchingOptions& options,
                              std::uint64_t seed, Progress& progress = no_progress(),
                              KnownMatches* known = nullptr);

// Returns an initial guess of first_from_second for a pair, from as few as six consistent matches;
// nullopt if the estimation fails. Throws Error as verify_pairs does.
std::optional<Pose> guess_motion(const std::vector<FrameFeatures>& frames, const FramePair& pair,
                                 const MatchingOptions& options, std::uint64_t seed);

// Indices of a frame and of a feature of the frame.
struct Observation {
  std::uint32_t frame = 0;
  std::uint32_t feature = 0;
  bool operator==(const Observation&) const = default;
};

struct FeatureTrack {
  std::vector<Observation> observations;  // by ascending frame, at most one per frame
};

struct FeatureTracks {
  std::vector<FeatureTrack> tracks;  // two or more observations each
  std::size_t conflicts = 0;         // dropped matches: a track would have two features of a frame
  std::size_t split = 0;             // dropped matches: a track would join frames without a link
};

// Frames that a track may join. linked: every two frames of a track have a link. A point with many
// observations then becomes several tracks, and normal equations are as sparse as the links.
enum class TrackFrames { any, linked };

// Joins matches into tracks by union-find, in ascending order of chi-square. Drops a match that
// would join two features of one frame, or unlinked frames for TrackFrames::linked.
FeatureTracks build_tracks(const std::vector<FrameFeatures>& frames,
                           const std::vector<FeatureLink>& links,
                           TrackFrames together = TrackFrames::any);

}  // namespace libmap
