// Opens a scan, and selects its poses and camera by the options --poses and --calibration.
#pragma once

#include <optional>

#include "libmap/camera/camera_io.h"
#include "libmap/core/pose_graph.h"
#include "libmap/scan/pose_import.h"
#include "libmap/scan/scan_source.h"
#include "tools/support/command_line.h"

namespace graspmap_tools {

// Value of --poses: auto, odometry, optimized, ground-truth or a file. auto: the first of
// optimized, odometry and ground-truth that the scan has. File: any format of import_poses.
struct PosesOption {
  std::string source = "auto";
  libmap::PoseImportOptions file;
};
void add_poses_option(Command& command, PosesOption& poses);

// Returns the number of nodes that the recording does not declare invalid.
std::size_t count_valid_nodes(const libmap::PoseGraph& graph);

// Returns the path of the scan and, if the poses are in a file, its path, for Run::claim_output.
std::vector<std::string> scan_inputs(const std::string& scan, const PosesOption& poses);

// Value of --calibration, the scan's camera with its depth correction: auto, stored or a file.
// auto: the camera in the manifest of the pose file, if it is of the same scan; else stored.
struct CalibrationOption {
  std::string source = "auto";
};
void add_calibration_option(Command& command, CalibrationOption& calibration);

// Returns the camera that the option selects; nullopt for the stored camera. Prints the sensor
// errors that its calibration corrects. Throws Error if the file cannot be read.
std::optional<libmap::CameraFile> known_camera(const CalibrationOption& calibration,
                                               const std::string& scan, const PosesOption& poses,
                                               Run& run);
// Adds the camera to the run's manifest, for poses that were estimated with it.
void add_camera(const libmap::CameraFile& camera, Run& run);

// Opens a scan; `camera` replaces the stored cameras. Data that cannot be read cause warnings, or,
// if `strict`, an Error. Throws Error for a scan without nodes.
std::unique_ptr<libmap::ScanSource> open_scan(const std::string& scan, bool strict, Run& run,
                                              const std::optional<libmap::CameraFile>& camera = {});
// Opens and joins several scans (join_scans).
std::unique_ptr<libmap::ScanSource> open_scan(const std::vector<std::string>& scans, bool strict,
                                              Run& run,
                                              const std::optional<libmap::CameraFile>& camera = {});

// Returns the poses (world_from_base, m) that the option selects, by ascending node. Replaces
// "auto" in `poses` by the source, and adds the source to the manifest. Throws Error if the scan
// has no poses of this source. Nodes without a pose cause a warning, or, if `strict`, an Error.
libmap::Trajectory find_poses(const libmap::ScanSource& scan, PosesOption& poses, bool strict,
                              Run& run);

// Returns true if the poses are from a file that, by its manifest, `refine` wrote.
bool are_refined(const PosesOption& poses);

// Returns the scan's true poses. Throws Error if it has none.
libmap::Trajectory require_truth(const libmap::ScanSource& scan);

// Returns the rigid transform that aligns `poses` with the scan's true poses; the identity if they
// are the true poses. Prints the alignment error and adds the transform to the manifest as
// ground_truth_from_poses. Throws Error if the scan has no true poses.
libmap::Pose truth_from_poses(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                              const PosesOption& taken, Run& run);

}  // namespace graspmap_tools
