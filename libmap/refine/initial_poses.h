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
  // Ascending nodes of each part, whose poses are in one frame: sessions, joined by links.
  std::vector<std::vector<int>> parts;
  std::vector<int> without_pose;  // valid nodes with neither a pose nor links to one
  std::string source;  // source of the poses: "odometry", "stored", "links", or "visual" for none
};

// Selects the initial poses. automatic: odometry if all valid nodes have it, else stored poses if
// there are any, else the available odometry, else links only. Nodes without a pose get one from
// links. Sessions with odometry but without links between them remain separate parts. visual
// returns no poses. Throws Error if `start` is odometry or stored and the scan has no such poses.
InitialPoses initial_poses(const PoseGraph& graph, StartPoses start);

// Joins parts that are connected by links: transforms the smaller part rigidly to satisfy one link
// to the larger part, the link with which most others agree. Returns all remaining parts.
std::vector<std::vector<int>> join_parts(std::map<int, Pose>& map_from_base,
                                         const std::vector<std::vector<int>>& parts,
                                         const std::vector<PoseLink>& links);

}  // namespace libmap
