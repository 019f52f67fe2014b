// Selects the initial poses of a scan for refinement: odometry, stored poses, or links.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// Source of initial poses. visual: neither poses nor motions of the scan are used, only images.
enum class StartPoses { automatic, odometry, stored, visual };

struct InitialPoses {
  std::map<int, Pose> map_from_base;
  // Groups of nodes (sessions, joined by links) with poses in one coordinate frame; nodes ascend.
  std::vector<std::vector<int>> parts;
  std::vector<int> without_pose;  // valid nodes (not GraphNode::invalid_weight)
  std::string source;             // "odometry", "stored", "links", or "visual" (no poses)
};

// Selects the initial poses. automatic: odometry if all valid nodes have it; otherwise stored
// poses, the available odometry or links, in this order. Nodes without a pose get one from links.
// Sessions with odometry but without links between them remain separate parts. visual returns no
// poses. Throws Error if `start` is odometry or stored and the scan has no poses of this source.
InitialPoses initial_poses(const PoseGraph& graph, StartPoses start);

// Joins parts that are connected by links. The smaller part is moved rigidly so that one link to
// the larger part is satisfied: the link that most others agree with. Returns all remaining parts.
std::vector<std::vector<int>> join_parts(std::map<int, Pose>& map_from_base,
                                         const std::vector<std::vector<int>>& parts,
                                         const std::vector<PoseLink>& links);

}  // namespace libmap
