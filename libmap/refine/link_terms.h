// What the links of a pose graph add to a bundle adjustment: those between two nodes, and those
// that place a node by itself (gravity, priors). Inner part of libmap/refine.
#pragma once

#include <map>
#include <vector>

#include "libmap/refine/block_system.h"
#include "libmap/refine/pose_graph_optimization.h"

namespace libmap {

// Half the weighted squares of links that are not rejected and whose nodes have poses.
double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links);

// Their normal equations: link_system, and what absolute links add.
BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links);

}  // namespace libmap
