// Imports a pose file of any format and assigns the poses to the frames of a scan.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Order of a quaternion's components in a file: x y z w, as the formats define, or w x y z.
enum class QuaternionOrder { xyzw, wxyz };
// Returns the pose that the file contains, if `read` was read as x y z w but is written in `order`.
Pose with_quaternion_order(const Pose& read, QuaternionOrder order);

struct PoseImportOptions {
  TrajectoryFormat format = TrajectoryFormat::automatic;  // format of the file
  QuaternionOrder quaternion = QuaternionOrder::xyzw;     // order in the file
  // Frame of the poses in the file: the robot's base, or the first camera's optical frame. Poses in
  // files of COLMAP, nerfstudio and Open3D are always of cameras.
  PoseFrame frame = PoseFrame::base;
  // > 0: meters per unit of the file's positions. 0: the least-squares scale (Umeyama 1991) to the
  // odometry of the scan's longest session or, without odometry, to its optimized poses.
  double scale = 1.0;
};
void bind(ParameterTable& table, PoseImportOptions& options);

struct ImportedPoses {
  NodeTrajectory trajectory;      // poses ascending by node id, and number of unmatched poses
  std::size_t poses_in_file = 0;  // number of poses in the file
  double scale = 1.0;             // meters per unit of the file's positions
  // Maximum distance from a node's position to the base position that one of its cameras yields.
  double max_rig_deviation_m = 0.0;
  // Reports dropped poses (no such camera, or no usable calibration). Also reports if distances or
  // rotations between successive poses differ from the scan's, as with a wrong unit or wrong axes.
  std::vector<std::string> warnings{};
};

// Assigns poses to nodes as assign_nodes (trajectory_io.h) does, but images of COLMAP and
// nerfstudio by the file name without folder: the name of the scan's image, a node id (000012.jpg,
// 12; 000012_1.jpg for the second camera), or a stamp within 20 ms (1305031102.175304.png).
// If several cameras of a node have a pose, the node's pose is the mean. Throws Error naming the
// file if no pose matches a node, two match the same camera, or the scale is undetermined.
ImportedPoses import_poses(const std::filesystem::path& path, const ScanSource& scan,
                           const PoseImportOptions& options = {});

}  // namespace libmap
