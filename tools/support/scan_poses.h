// A scan and the poses at which its frames were, as commands take them: SCAN and `--poses`.
#pragma once

#include <optional>

#include "libmap/camera/camera_io.h"
#include "libmap/core/pose_graph.h"
#include "libmap/scan/pose_import.h"
#include "libmap/scan/scan_source.h"
#include "tools/support/command_line.h"

namespace graspmap_tools {

// --poses auto|odometry|optimized|ground-truth|FILE. auto: the first of optimized, odometry and
// ground-truth that the scan has; FILE: any that import_poses reads.
struct PosesOption {
  std::string source = "auto";
  libmap::PoseImportOptions file;
};
void add_poses_option(Command& command, PosesOption& poses);

// Without those that the recording itself declares invalid.
std::size_t count_valid_nodes(const libmap::PoseGraph& graph);

// The files among the two, for Run::claim_output.
std::vector<std::string> scan_inputs(const std::string& scan, const PosesOption& poses);

// --calibration auto|stored|FILE: the scan's camera as it is known now, its depth correction
// included. auto: as `poses`, if a file, were estimated with, by their manifest, of the same scan.
struct CalibrationOption {
  std::string source = "auto";
};
void add_calibration_option(Command& command, CalibrationOption& calibration);

// That camera; nothing for the stored one. Says what is known of it. Throws Error: no such file.
std::optional<libmap::CameraFile> known_camera(const CalibrationOption& calibration,
                                               const std::string& scan, const PosesOption& poses,
                                               Run& run);
// Names the camera in the manifests of outputs from here on: of the poses that go with it.
void add_camera(const libmap::CameraFile& camera, Run& run);

// Opens a scan; what it had to leave out is a warning, an Error if `strict`. Its frames are those
// of the camera, if there is one.
std::unique_ptr<libmap::ScanSource> open_scan(const std::string& scan, bool strict, Run& run,
                                              const std::optional<libmap::CameraFile>& camera = {});
// The same of several scans, joined (join_scans).
std::unique_ptr<libmap::ScanSource> open_scan(const std::vector<std::string>& scans, bool strict,
                                              Run& run,
                                              const std::optional<libmap::CameraFile>& camera = {});

// The poses that `poses` names, by ascending node; "auto" becomes the source that was taken. Says
// so, and keeps it in the manifest. Nodes without a pose are a warning, an Error if `strict`.
// Throws Error if there are no such poses.
libmap::Trajectory find_poses(const libmap::ScanSource& scan, PosesOption& poses, bool strict,
                              Run& run);

// Whether the manifest of a file of poses names `refine` as the command that wrote them.
bool are_refined(const PosesOption& poses);

// The scan's true poses. Throws Error if it has none.
libmap::Trajectory require_truth(const libmap::ScanSource& scan);

// The rigid transform that aligns `poses` with the scan's true ones; the identity where they are
// those. Says how well, and keeps it in the manifest as ground_truth_from_poses. Throws Error if
// the scan has no ground truth.
libmap::Pose truth_from_poses(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                              const PosesOption& taken, Run& run);

}  // namespace graspmap_tools
