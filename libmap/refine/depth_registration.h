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
      scan{};  // scan with registered depth; nullptr: the given scan is registered
  Pose color_from_depth = Pose::Identity();  // in the given scan
  std::string finding{};                     // empty if depth is registered
};

// Registers the depth of all frames if edges of depth are displaced (check_edge_agreement). Without
// `may_register`, only states the displacement. The scan must outlive the result. Throws Error: the
// depth camera has another focal length than the color camera.
CoarseRegistration register_coarsely(const ScanSource& scan, bool may_register);

// Adds the coarse registration to a calibration of the registered scan.
void add_registration(const Pose& color_from_depth, std::size_t cameras,
                      SensorCalibration& calibration);

}  // namespace libmap
