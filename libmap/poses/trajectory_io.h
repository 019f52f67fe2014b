// Reads and writes trajectory and pose graph files (formats: trajectory_text.h, colmap_io.h), and
// assigns poses to the nodes of a scan.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// Formats; comments give RTAB-Map's numbers. `automatic` recognizes the extensions .tum, .kitti,
// .g2o and .toro; a folder or images.txt as a COLMAP model; other files (.txt, .graph, .csv) by
// content. Formats 1 and 2 have other axes, which files do not state, so they must be selected.
enum class TrajectoryFormat {
  automatic,
  tum,                 // 10, 11
  tum_motion_capture,  // 1
  kitti,               // 0, with the axes of the map
  kitti_optical,       // 2
  toro,                // 3
  g2o,                 // 4
  colmap,
  open3d,      // this and the following formats are read-only
  nerfstudio,  // transforms.json
  euroc
};
const std::vector<std::pair<std::string, TrajectoryFormat>>& trajectory_format_names();

struct TrajectoryFile {
  Trajectory poses;                 // world_from_base; node and stamp are 0 if the format has none
  std::vector<PoseLink> links;      // g2o and TORO only
  std::vector<ImagePose> images{};  // COLMAP and nerfstudio, instead of poses
  bool of_cameras = false;          // true if the poses are of the first camera (Open3D)
};

// True if write_trajectory supports the extension: .tum, .kitti, .g2o, .toro.
bool is_trajectory_path(const std::filesystem::path& path);
// Throws Error, which lists these extensions, for any other extension.
void require_trajectory_format(const std::filesystem::path& path);

// Reads a file. Throws Error naming file and line if it is invalid or contains no pose.
TrajectoryFile read_trajectory(const std::filesystem::path& path,
                               TrajectoryFormat format = TrajectoryFormat::automatic);

// Returns the file that read_trajectory reads: `path` itself, or the images.txt of a COLMAP model.
std::filesystem::path file_of_trajectory(const std::filesystem::path& path);

// Writes in the format of the extension, directly to `path`; for atomic output, pass the temporary
// path of an OutputFile. .g2o and .toro also contain links, and node ids (1, 2, ... if unknown).
// .tum has the node id as a ninth column, which not all readers support, if `nodes` is true or
// stamps repeat. Throws Error for another extension; Error (failed) if the write fails.
void write_trajectory(const std::filesystem::path& path, const TrajectoryFile& trajectory,
                      bool nodes = false);
// As write_trajectory, in a given format. Throws Error for automatic, colmap, read-only formats.
void write_trajectory_as(TrajectoryFormat format, const std::filesystem::path& path,
                         const TrajectoryFile& trajectory, bool nodes = false);

// A trajectory assigned to the nodes of a scan.
struct NodeTrajectory {
  Trajectory poses;           // with node and stamp, by ascending node
  std::size_t unmatched = 0;  // number of poses that match no node, and are dropped
};

// Assigns poses to nodes: by node id if all poses have one, else by stamp within 20 ms if any pose
// has a stamp, else by order. The assignment by order requires as many poses as the scan has valid
// nodes (GraphNode::invalid_weight), or valid nodes with an optimized pose; else it throws Error.
// Throws Error (without the file's name) if no pose matches or a node has two poses.
NodeTrajectory assign_nodes(const Trajectory& trajectory, const PoseGraph& graph);

}  // namespace libmap
