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

// Order of the quaternions in a file: the format's order, or w first.
enum class QuaternionOrder { xyzw, wxyz };
// Corrects a pose with a quaternion that was read as x y z w but written in `order`.
Pose with_quaternion_order(const Pose& read, QuaternionOrder order);

struct PoseImportOptions {
  TrajectoryFormat format = TrajectoryFormat::automatic;
  QuaternionOrder quaternion = QuaternionOrder::xyzw;
  // Frame of the poses in the file: the base, or the first camera's optical frame. Poses of COLMAP
  // are always of cameras.
  PoseFrame frame = PoseFrame::base;
  // Meters per unit of the file's positions. 0: the least-squares scale to the scan's odometry,
  // else to the scan's stored poses (Umeyama 1991).
  double scale = 1.0;
};
void bind(ParameterTable& table, PoseImportOptions& options);

struct ImportedPoses {
  NodeTrajectory trajectory;
  std::size_t poses_in_file = 0;
  double scale = 1.0;                // meters per unit, as applied
  double max_rig_deviation_m = 0.0;  // maximum deviation of a node's cameras from the mean pose
  // Reports poses dropped because of an unusable calibration, and motion between neighbors that
  // differs from the scan's in length (wrong scale) or axes (wrong format or frame).
  std::vector<std::string> warnings{};
};

// Assigns poses to nodes as assign_nodes does. Images of COLMAP are assigned by name in any folder:
// the scan's own file name, the node's number (`000012.jpg`, `12`; `000012_1.jpg` is its second
// camera), or a stamp within 20 ms (`1305031102.175304.png`). If several cameras of a rig have a
// pose, the node's pose is the mean. Throws Error naming the file if no pose matches a node, two
// poses match the same camera, or the scale is undetermined.
ImportedPoses import_poses(const std::filesystem::path& path, const ScanSource& scan,
                           const PoseImportOptions& options = {});

}  // namespace libmap
