// Poses of a scan as a command's output, in the format that its name says: .tum, .kitti, .g2o,
// .toro, or NAME.colmap, a folder with a model of COLMAP that has no points.
#pragma once

#include <string>
#include <vector>

#include "libmap/scan/scan_source.h"
#include "libmap/trajectory/trajectory_io.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Before the work. Throws Error if the name says no format.
void claim_poses_output(const std::string& path, const std::vector<std::string>& inputs, Run& run);

// `nodes` as in libmap::write_trajectory. A model of COLMAP has the scan's calibrations and names
// its images as `convert --colmap` does; frames without a photograph or a calibration are left out
// with a warning.
void write_poses_output(const std::string& path, const libmap::TrajectoryFile& poses,
                        const libmap::ScanSource& scan, bool nodes, Run& run);

}  // namespace graspmap_tools
