// Trajectories and pose graphs as files, by extension: .tum, .kitti, .g2o (scan/trajectory_text.h
// describes the formats).
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

struct TrajectoryFile {
  Trajectory poses;             // node 0 and stamp 0 where the format has none
  std::vector<PoseLink> links;  // of .g2o
};

// Throws Error unless the extension is a known one, naming the known ones.
void require_trajectory_format(const std::filesystem::path& path);
bool is_trajectory_path(const std::filesystem::path& path);

// Throws Error naming file and line; a file without any pose is one.
TrajectoryFile read_trajectory(const std::filesystem::path& path);

// For callers that hold an OutputFile. Links are left out but in .g2o; nodes stand in .g2o and, as
// a ninth column that not every reader takes, in .tum where `nodes` is set.
void write_trajectory(const std::filesystem::path& path, const TrajectoryFile& trajectory,
                      bool nodes = false);

// A trajectory bound to the nodes of a scan.
struct NodeTrajectory {
  Trajectory poses;         // with node and stamp, by ascending node
  std::size_t foreign = 0;  // poses of the file that belong to no node; left out
};

// By the poses' own nodes where all are known; else by stamps, within 20 ms; a trajectory without
// either must have as many poses as the graph has valid nodes, in their order. Throws Error naming
// no file: nothing matches, a node has two poses.
NodeTrajectory assign_nodes(const Trajectory& trajectory, const PoseGraph& graph);

}  // namespace libmap
