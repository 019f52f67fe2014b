// How bright each photograph is against the others, and how a lens darkens towards its corners:
// what colors are divided by before they are put side by side. Private to libmap/texture.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "libmap/texture/texture_views.h"

namespace libmap {

struct TextureExposure {
  std::vector<Eigen::Vector3f> gains;         // of each photograph and channel; 1 on the mean
  std::array<double, 3> vignetting{0, 0, 0};  // log of brightness: a r^2 + b r^4 + c r^6
  std::size_t observations = 0;
  // Standard deviation of ln(color) between photographs of one place, before and after.
  double spread_before = 0.0;
  double spread = 0.0;

  // What a color of `photo` is divided by; radius2 as in ColorObservation.
  Eigen::Vector3f factor(std::size_t photo, double radius2) const;
};

struct ExposureOptions {
  bool gains = true;
  bool vignetting = true;
};

// Least squares over all places that several photographs show (Brown and Lowe 2007, equation 29, in
// logarithms; the lens as in Goldman and Chen 2005), with Huber weights against colors that do not
// belong together. `observations` may be in any order; those near black or saturated are left out.
TextureExposure even_out_exposure(std::span<const ColorObservation> observations,
                                  std::size_t photos, const ExposureOptions& options);

}  // namespace libmap
