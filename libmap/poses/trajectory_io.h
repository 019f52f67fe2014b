// Trajectories and pose graphs as files (scan/trajectory_text.h and scan/colmap_io.h describe the
// formats).
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// Beside the number that RTAB-Map gives to a format. `automatic`: by the extension .tum, .kitti,
// .g2o, .toro; a folder or images.txt is a model of COLMAP; any other name (.txt, .graph, .csv) by
// its content. What turns the axes (1 and 2) is not to be seen in a file, so it must be named.
enum class TrajectoryFormat {
  automatic,
  tum,                 // 10, 11
  tum_motion_capture,  // 1
  kitti,               // 0: the axes of the map
  kitti_optical,       // 2
  toro,                // 3
  g2o,                 // 4
  colmap,
  open3d,      // read only, as the next two
  nerfstudio,  // transforms.json
  euroc
};
const std::vector<std::pair<std::string, TrajectoryFormat>>& trajectory_format_names();

struct TrajectoryFile {
  Trajectory poses;                 // node 0 and stamp 0 where the format has none
  std::vector<PoseLink> links;      // of g2o and TORO
  std::vector<ImagePose> images{};  // of COLMAP and nerfstudio, which have no poses
  bool of_cameras = false;          // poses of the first camera's optical frame: Open3D
};

// Whether write_trajectory takes it: .tum, .kitti, .g2o, .toro. The second throws Error if not,
// naming them.
bool is_trajectory_path(const std::filesystem::path& path);
void require_trajectory_format(const std::filesystem::path& path);

// Throws Error naming file and line; a file without any pose is one.
TrajectoryFile read_trajectory(const std::filesystem::path& path,
                               TrajectoryFormat format = TrajectoryFormat::automatic);

// The file that read_trajectory reads: `path` itself, or the images.txt of a model.
std::filesystem::path file_of_trajectory(const std::filesystem::path& path);

// For callers that hold an OutputFile, by the extension. Links are left out but in .g2o and .toro;
// nodes stand in those (1, 2, ... where none is known) and, as a ninth column that not every reader
// takes, in .tum where `nodes` is set.
void write_trajectory(const std::filesystem::path& path, const TrajectoryFile& trajectory,
                      bool nodes = false);
// The same in a format that the extension does not say. Throws Error for automatic and colmap.
void write_trajectory_as(TrajectoryFormat format, const std::filesystem::path& path,
                         const TrajectoryFile& trajectory, bool nodes = false);

// A trajectory bound to the nodes of a scan.
struct NodeTrajectory {
  Trajectory poses;         // with node and stamp, by ascending node
  std::size_t foreign = 0;  // poses of the file that belong to no node; left out
};

// By the poses' own nodes where all are known; else by stamps, within 20 ms; a trajectory without
// either must have as many poses as the graph has valid nodes, or as it has nodes with a stored
// pose, in their order. Throws Error naming no file: nothing matches, a node has two poses.
NodeTrajectory assign_nodes(const Trajectory& trajectory, const PoseGraph& graph);

}  // namespace libmap
