// Detects depth that is not registered to color, and registers depth coarsely before refinement.
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
  Pose color_from_depth = Pose::Identity();  // of the depth camera; identity without `scan`
  std::string finding{};                     // displacement of depth; empty if there is none
};

// Registers the depth of all frames if depth edges are displaced from color edges
// (check_edge_agreement). Without `may_register`, only sets `finding`. `scan` must outlive the
// result. Throws Error if `may_register` and the stored focal length of depth is wrong.
CoarseRegistration register_coarsely(const ScanSource& scan, bool may_register);

// Adds the coarse registration to the `calibration` of a registered scan with `cameras` cameras.
void add_registration(const Pose& color_from_depth, std::size_t cameras,
                      SensorCalibration& calibration);

}  // namespace libmap
