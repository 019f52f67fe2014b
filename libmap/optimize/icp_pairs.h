// The pairs of frames whose surfaces are laid against each other. Inner part of icp_refinement.
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

// Those that links join, in ascending order, the lower frame first. Frames without a pose are left
// out.
std::vector<FramePair> linked_pairs(const std::vector<FrameFeatures>& frames,
                                    const std::map<int, Pose>& map_from_base,
                                    const std::vector<PoseLink>& links);

// Each frame with those of its component whose surfaces overlap its own most by their poses, in the
// same order: `min_overlap` and `pairs_per_frame` of the options. The same for any number of
// threads.
std::vector<FramePair> overlapping_pairs(const std::vector<FrameFeatures>& frames,
                                         const std::map<int, Pose>& map_from_base,
                                         const std::vector<GraphComponent>& components,
                                         const IcpOptions& options);

}  // namespace libmap
