// Poses of a file, of any format, for the frames of a scan.
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

// Order of the numbers of a file's quaternions: that of its format, or w first.
enum class QuaternionOrder { xyzw, wxyz };
// The pose whose quaternion, read as x y z w, was written in `order`.
Pose with_quaternion_order(const Pose& read, QuaternionOrder order);

struct PoseImportOptions {
  TrajectoryFormat format = TrajectoryFormat::automatic;
  QuaternionOrder quaternion = QuaternionOrder::xyzw;
  // Whose poses the file holds: the base's, or those of the first camera's optical frame. Those of
  // COLMAP are always the cameras'.
  PoseFrame frame = PoseFrame::base;
  // Meters a unit of the file's positions. 0: the one that fits the scan's own positions best
  // (Umeyama 1991): its odometry's, else its stored ones.
  double scale = 1.0;
};
void bind(ParameterTable& table, PoseImportOptions& options);

struct ImportedPoses {
  NodeTrajectory trajectory;
  std::size_t poses_in_file = 0;
  double scale = 1.0;                    // that was taken
  double largest_rig_deviation_m = 0.0;  // of the cameras of one node from their mean
  // Poses left out since their node's calibration is of no use. Motion between neighbors that is
  // not at all the scan's own: by another length (the scale), or about other axes (the format, the
  // frame).
  std::vector<std::string> warnings{};
};

// Poses are bound to nodes as assign_nodes does; images of COLMAP by their names, whatever their
// folder: the name of the file that the scan itself reads, the node's number (`000012.jpg`, `12`;
// `000012_1.jpg` is its second camera), or a stamp within 20 ms (`1305031102.175304.png`). A node
// that several cameras of a rig see has the mean of the poses that they give. Throws Error naming
// the file: none is a node's, two are of one node, the scale cannot be found.
ImportedPoses import_poses(const std::filesystem::path& path, const ScanSource& scan,
                           const PoseImportOptions& options = {});

}  // namespace libmap
