// Detects depth that is not registered to color, and registers it coarsely before refinement.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libmap/refine/sensor_calibration.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

struct CoarseRegistration {
  std::unique_ptr<ScanSource>
      scan{};  // scan with registered depth; nullptr: the given scan is used
  Pose color_from_depth = Pose::Identity();  // true pose of depth; identity without `scan`
  std::string finding{};                     // displacement of depth; empty if there is none
};

// Registers the depth of all frames if edges of depth are displaced (check_edge_agreement). Without
// `may_register`, only returns the finding. The scan must outlive the result. Throws Error if
// `may_register` and the depth camera has another focal length than stored.
CoarseRegistration register_coarsely(const ScanSource& scan, bool may_register);

// Adds the coarse registration of all `cameras` to a calibration of the registered scan.
void add_registration(const Pose& color_from_depth, std::size_t cameras,
                      SensorCalibration& calibration);

}  // namespace libmap
