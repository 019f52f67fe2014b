// Candidates for loop closures, and their check against the pose graph.
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
  double radius_m = 1.0;       // >= 0: candidates lie this near to each other ...
  double angle_deg = 60.0;     // >= 0: ... and look in directions that differ by this at most
  int near_candidates = 10;    // >= 0: of a frame, the nearest
  int similar_candidates = 4;  // >= 0: of a frame, those that look most like it
  int neighbors = 2;           // >= 0: of a frame, those that follow it in time
  double max_graph_chi_square = 22.5;  // > 0: of a closure against the graph; 99.9 %
  double graph_slack_m = 0.01;         // >= 0: added to what the graph claims to know
  double graph_slack_deg = 0.4;
  PlaceRecognitionOptions appearance{};
};
void bind(ParameterTable& table, LoopClosureDetectionOptions& options);

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

// Drops links that contradict the graph: by chi-square against the covariance of the relative pose
// where the graph connects their nodes; where it does not, unless another link between the same two
// components agrees.
void check_against_graph(std::vector<FeatureLink>& links, const PoseGraphResult& graph,
                         const LoopClosureDetectionOptions& options, RejectionCounts& counts);

}  // namespace libmap
