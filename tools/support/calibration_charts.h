// The pictures in a calibration's report.
#pragma once

#include <string>

#include "libmap/calibration/camera_calibration.h"

namespace graspmap_tools {

// PNG: where in the image the corners were, each with its residual, magnified.
std::string draw_residuals(const libmap::CameraCalibrationResult& result);

// PNG: a bar for each picture's error, and a line at `bound_px`.
std::string draw_errors(const libmap::CameraCalibrationResult& result, double bound_px);

}  // namespace graspmap_tools
