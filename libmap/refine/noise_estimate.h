// Noise of a depth camera by range, from the scan itself.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libmap/features/held_out.h"
#include "libmap/fusion/depth_noise.h"

namespace libmap {

struct NoiseEstimate {
  DepthNoise noise{};
  std::size_t residuals = 0;
  double nearest_m = 0.0;  // ranges of the residuals
  double farthest_m = 0.0;
  double largest_ratio = 1.0;  // >= 1: of estimated and assumed noise at a range, or its inverse
};

// Constant, linear and quadratic terms that fit the robust spread of the residuals in bins of range
// best, none negative. Returns nullopt for fewer than a thousand residuals.
std::optional<NoiseEstimate> estimate_noise(const std::vector<SurfaceResidual>& residuals,
                                            const DepthNoise& assumed);

// "1.2 mm + 0.10 % of range + 1.9 mm/m2 of range squared".
std::string describe(const DepthNoise& noise);

}  // namespace libmap
