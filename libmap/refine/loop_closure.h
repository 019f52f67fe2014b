// Which frames of a scan see the same place, and how they lie to each other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/place_recognition.h"
#include "libmap/refine/relative_pose.h"

namespace libmap {

struct LoopClosureDetectionOptions {
  double radius_m = 1.0;       // >= 0: candidates lie this near to each other ...
  double angle_deg = 60.0;     // >= 0: ... and look in directions that differ by this at most
  int near_candidates = 10;    // >= 0: of a frame, the nearest
  int similar_candidates = 4;  // >= 0: of a frame, those that look most like it
  int neighbors = 2;           // >= 0: of a frame, those that follow it in time
  double max_ratio = 0.8;      // > 0: of the descriptors' distances (match_features)
  int held_out = 10;           // >= 2: every so many features serve for checks alone
  double max_graph_chi_square = 22.5;  // > 0: of a closure against the graph; 99.9 %
  double graph_slack_m = 0.01;         // >= 0: added to what the graph claims to know
  double graph_slack_deg = 0.4;
  RelativePoseOptions estimate{};
  PlaceRecognitionOptions appearance{};
};
void bind(ParameterTable& table, LoopClosureDetectionOptions& options);

// Two frames, by their places in the list of frames; first < second.
using FramePair = std::pair<std::size_t, std::size_t>;

// Frames that follow each other, in the list, up to `neighbors` apart.
std::set<FramePair> consecutive_pairs(const std::vector<FrameFeatures>& frames, int neighbors);
// By appearance over the whole scan; where there are several components, as many between them too.
std::set<FramePair> similar_pairs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<GraphComponent>& components,
                                  const LoopClosureDetectionOptions& options, std::uint64_t seed);
// By the poses, within a component of the graph. Frames without pose have none.
std::set<FramePair> near_pairs(const std::vector<FrameFeatures>& frames,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<GraphComponent>& components,
                               const LoopClosureDetectionOptions& options);

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
                              const std::vector<FramePair>& pairs,
                              const LoopClosureDetectionOptions& options, std::uint64_t seed,
                              Progress& progress = no_progress(), KnownMatches* known = nullptr);

// The motion that some matches of a pair agree on, be they too few for a link: a guess.
std::optional<Pose> guess_motion(const std::vector<FrameFeatures>& frames, const FramePair& pair,
                                 const LoopClosureDetectionOptions& options, std::uint64_t seed);

// Drops links that contradict the graph: by chi-square against the covariance of the relative pose
// where the graph connects their nodes; where it does not, unless another link between the same two
// components agrees.
void check_against_graph(std::vector<FeatureLink>& links, const PoseGraphResult& graph,
                         const LoopClosureDetectionOptions& options, RejectionCounts& counts);

}  // namespace libmap
