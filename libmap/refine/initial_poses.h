// Where an optimization of a scan's poses starts.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// visual: no pose and no motion that the scan states, its pictures alone.
enum class StartPoses { automatic, odometry, stored, visual };

struct InitialPoses {
  std::map<int, Pose> map_from_base;
  // Nodes whose poses are in one frame: sessions, until links between them join them.
  std::vector<std::vector<int>> parts;
  std::vector<int> without_pose;  // valid nodes that neither a pose nor links place
  std::string source;             // "odometry", "stored", "links", "visual"
};

// automatic: odometry where all of the valid nodes have it, else stored poses where there are any,
// else what odometry there is, else links alone. Nodes without a pose are placed by links. Sessions
// are in frames of their own, but where stored links join them. visual places none. Throws Error if
// odometry or stored poses are asked for and there are none.
InitialPoses initial_poses(const PoseGraph& graph, StartPoses start);

// Carries parts as wholes to where the links between them say, the largest part first; of several
// links between two parts that one which most others agree with. Returns the joined parts.
std::vector<std::vector<int>> join_parts(std::map<int, Pose>& map_from_base,
                                         const std::vector<std::vector<int>>& parts,
                                         const std::vector<PoseLink>& links);

}  // namespace libmap
