// Estimates the exposure of photographs and the vignetting of the lens from common surface points.
// Colors are divided by both before blending. Private to libmap/texture.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "libmap/texture/texture_views.h"

namespace libmap {

struct TextureExposure {
  std::vector<Eigen::Vector3f> gains;         // per photograph and channel, relative to the mean
  std::array<double, 3> vignetting{0, 0, 0};  // log of brightness: a r^2 + b r^4 + c r^6
  std::size_t observations = 0;
  // Standard deviation of ln(color) of one surface point between photographs, before and after.
  double log_color_deviation_before = 0.0;
  double log_color_deviation = 0.0;

  // Divisor of the colors of `photo`, per channel; radius2 as in ColorObservation.
  Eigen::Vector3f factor(std::size_t photo, double radius2) const;
};

struct ExposureOptions {
  bool gains = true;
  bool vignetting = true;
};

// Estimates exposure by least squares over all points seen in several photographs (Brown and Lowe
// 2007, equation 29, in logarithms; vignetting as in Goldman and Chen 2005), with Huber weights
// against outliers. `observations` may be in any order; dark and saturated colors are ignored.
// Gains are 1 and vignetting is 0 without observations.
TextureExposure estimate_exposure(std::span<const ColorObservation> observations,
                                  std::size_t photos, const ExposureOptions& options);

}  // namespace libmap
