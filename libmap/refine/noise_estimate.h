// Estimates the noise of a depth camera as a function of range from a scan.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libmap/features/held_out.h"
#include "libmap/fusion/depth_noise.h"

namespace libmap {

struct NoiseEstimate {
  DepthNoise noise{};
  std::size_t residuals = 0;  // number of residuals used
  double nearest_m = 0.0;     // minimum range of the residuals
  double farthest_m = 0.0;
  double largest_ratio = 1.0;  // >= 1: maximum of estimated / assumed noise or assumed / estimated
};

// Fits non-negative constant, linear and quadratic terms to the robust spread of the residuals in
// bins of range. Returns nullopt for fewer than a thousand residuals.
std::optional<NoiseEstimate> estimate_noise(const std::vector<SurfaceResidual>& residuals,
                                            const DepthNoise& assumed);

// Returns the terms as text, e.g. "1.2 mm + 0.10 % of range + 1.9 mm/m2 of range squared".
std::string describe(const DepthNoise& noise);

}  // namespace libmap
