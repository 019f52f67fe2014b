// Selects the pairs of frames that ICP aligns. Private to icp_refinement.
#pragma once

#include <map>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/core/pose_graph.h"
#include "libmap/features/feature_tracks.h"
#include "libmap/features/features.h"
#include "libmap/optimize/icp_refinement.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// Returns linked pairs of frames in ascending order. Frames without a pose are ignored.
std::vector<FramePair> linked_pairs(const std::vector<FrameFeatures>& frames,
                                    const std::map<int, Pose>& map_from_base,
                                    const std::vector<PoseLink>& links);

// Returns pairs of each frame with the `pairs_per_frame` frames of the same component whose
// surfaces have the largest overlap (share >= `min_overlap`), in ascending order, smaller index
// first. Compares only the 24 nearest frames by distance / 2.5 m + rotation / 100 deg, each <= 1.
std::vector<FramePair> overlapping_pairs(const std::vector<FrameFeatures>& frames,
                                         const std::map<int, Pose>& map_from_base,
                                         const std::vector<GraphComponent>& components,
                                         const IcpOptions& options);

}  // namespace libmap
