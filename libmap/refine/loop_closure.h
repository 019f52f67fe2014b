// Finds candidates for loop closures (links between frames that see the same ground at different
// times), and rejects closures that contradict the pose graph.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/features/feature_tracks.h"
#include "libmap/features/place_recognition.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

struct LoopClosureDetectionOptions : MatchingOptions {
  double radius_m = 1.0;       // >= 0: maximum distance between the poses of a near candidate
  double angle_deg = 60.0;     // 0 to 180: maximum rotation between the poses of a near candidate
  int near_candidates = 10;    // >= 0: maximum number of near candidates per frame
  int similar_candidates = 4;  // >= 0: maximum number of candidates by appearance per frame
  int neighbors = 2;           // >= 0: number of following frames with which a frame is matched
  // > 0: maximum chi-square against the pose graph; 99.9 % of true closures have less.
  double max_graph_chi_square = 22.5;
  double graph_slack_m = 0.01;   // >= 0: added to the pose graph's position noise, in quadrature
  double graph_slack_deg = 0.4;  // >= 0: added to the pose graph's rotation noise, in quadrature
  PlaceRecognitionOptions appearance{};
};
void bind(ParameterTable& table, LoopClosureDetectionOptions& options);

// Returns pairs of indices of frames whose indices differ by at most `neighbors`.
std::set<FramePair> consecutive_pairs(const std::vector<FrameFeatures>& frames, int neighbors);
// Returns pairs of frames of similar appearance whose indices differ by more than `neighbors`. With
// several components, each frame also gets up to `similar_candidates` frames of other components.
std::set<FramePair> similar_pairs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<GraphComponent>& components,
                                  const LoopClosureDetectionOptions& options, std::uint64_t seed);
// Returns pairs of each frame with up to near_candidates frames of its component: those with the
// nearest poses within radius_m and angle_deg. Ignores frames without a pose.
std::set<FramePair> near_pairs(const std::vector<FrameFeatures>& frames,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<GraphComponent>& components,
                               const LoopClosureDetectionOptions& options);

// Drops links that contradict the pose graph and counts them in `counts`. If the graph connects
// both nodes of a link, the test is chi-square against the covariance of the relative pose.
// Otherwise, another element of `links` between the same two components must agree.
void check_against_graph(std::vector<FeatureLink>& links, const PoseGraphResult& graph,
                         const LoopClosureDetectionOptions& options, RejectionCounts& counts);

}  // namespace libmap
