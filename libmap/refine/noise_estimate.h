// Estimates the noise of a depth camera as a function of range from a scan.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/features/held_out.h"
#include "libmap/fusion/depth_planes.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

struct NoiseEstimate {
  DepthNoise noise{};
  std::size_t residuals = 0;   // number of residuals used
  double nearest_m = 0.0;      // median range of the nearest tenth of the residuals
  double farthest_m = 0.0;     // median range of the farthest tenth
  double largest_ratio = 1.0;  // >= 1: largest factor between estimated and assumed noise
};

// Fits constant, linear and quadratic terms of range, >= 0, to the robust spread of the residuals
// in ten bins of range. Returns nullopt for fewer than a thousand residuals that are not NaN.
std::optional<NoiseEstimate> estimate_noise(const std::vector<SurfaceResidual>& residuals,
                                            const DepthNoise& assumed);

// Noise that a stage uses for a scan.
struct ScanNoise {
  DepthNoise noise{};
  bool is_estimated = false;  // true: the estimate replaces the assumed noise
  std::string sentence{};     // noise and its source, for reports
};
// Returns the estimate if it differs from the assumed noise by more than a factor of 1.8 at any
// range, else the assumed noise.
ScanNoise choose_noise(const std::vector<SurfaceResidual>& residuals, const DepthNoise& assumed);

// Chooses by residuals of held-out depth in up to 12 pairs of near frames, aligned by the rest of
// their depth. Keeps the noise of `planes` if is_noise_given. Ignores frames that cannot be read.
ScanNoise choose_noise(const ScanSource& scan, const Trajectory& world_from_base,
                       const std::string& sensor, const DepthPlaneOptions& planes,
                       Progress& progress = no_progress());

// Returns true if `sensor` is not "auto", or an axial term of the noise is not the default.
bool is_noise_given(const std::string& sensor, const DepthNoise& noise);

// Returns the terms as text, e.g. "1.2 mm + 0.10 % of range + 1.90 mm/m2 of range squared".
std::string describe(const DepthNoise& noise);

}  // namespace libmap
