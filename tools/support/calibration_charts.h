// The pictures in a calibration's report.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace graspmap_tools {

struct PictureResiduals {
  std::string name;
  double rms_px = 0.0;
  std::vector<Eigen::Vector2d> corners;       // pixels
  std::vector<Eigen::Vector2d> residuals_px;  // as long as `corners`
};

// PNG: where in the image the corners were, each with its residual, magnified.
std::string draw_residuals(const std::vector<PictureResiduals>& pictures, int width, int height);

// PNG: a bar for each picture's error, and a line at `bound_px`.
std::string draw_errors(const std::vector<PictureResiduals>& pictures, double bound_px);

}  // namespace graspmap_tools
