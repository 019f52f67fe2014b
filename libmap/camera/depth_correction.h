// A smooth correction of a camera's depth: what is added to it as a function of depth (a uniform
// cubic B-spline) and of the radius in the image, and a scale of the sum. Linear in the numbers
// that are added, so that they are estimated by least squares. Teichman et al. (2013) correct each
// range and each place in the image; a scan has too few data for that.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

struct DepthCorrection {
  double first_m = 0.0;            // nearer depths are corrected as this one, farther than last_m()
                                   // as that one
  double step_m = 0.0;             // between the spline's knots
  std::vector<double> spline_m{};  // its coefficients, 4 or more; empty: no correction at all
  std::array<double, 3> radial{};  // of r^2 and r^4 (m), of depth r^2; r is 1 in corners
  double scale = 1.0;              // of the sum

  // What a depth takes from the spline (the coefficients from `first` on) and from the radial
  // terms.
  struct Terms {
    std::size_t first = 0;
    std::array<double, 4> spline{};
    std::array<double, 3> radial{};
  };

  bool empty() const { return spline_m.empty() && scale == 1.0; }
  double last_m() const { return first_m + step_m * (static_cast<double>(spline_m.size()) - 3.0); }
  // At a depth, and a squared radius as of `at`.
  Terms terms(double depth_m, double radius2) const;
  // The corrected depth less `depth_m`.
  double at(double depth_m, double radius2) const;
  // The same without the change by the scale alone.
  double bend(double depth_m, double radius2) const {
    return at(depth_m, radius2) - (scale - 1.0) * depth_m;
  }
  // Throws Error naming the field: a step > 0, no or 4 to 1000 coefficients of less than 1 m each,
  // a scale from 0.5 to 2.
  void check() const;
  bool operator==(const DepthCorrection&) const = default;
};

// From the middle of the image, squared, of that of its corners' pixels.
double squared_image_radius(int width, int height, double x_px, double y_px);

// Pixels without a depth stay so.
void correct_depth(DepthImage& depth, const DepthCorrection& correction);

// Each measurement covers the pixels of `target` on which its own pixel falls, the nearest one
// where several do; pixels that the depth camera cannot see stay without depth.
DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera);

}  // namespace libmap
