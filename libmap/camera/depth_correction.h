// Corrects systematic errors of a depth camera, and registers depth images to another camera. With
// a uniform cubic B-spline S, factors c and the image radius r (1 in the corners):
//   corrected depth = scale * (depth + offset)
//   offset = S(depth) + c[0] r^2 + c[1] r^4 + c[2] depth r^2
// The offset is linear in the coefficients, which are estimated by least squares. (Teichman et al.
// 2013 correct each range and pixel, which needs more data than one scan.)
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

struct DepthCorrection {
  double first_m = 0.0;            // depth in the offset is limited to first_m ... last_m()
  double step_m = 0.0;             // distance between the spline's knots; > 0 if there is a spline
  std::vector<double> spline_m{};  // coefficients of S, at least 4; empty: the offset is 0
  std::array<double, 3> radial{};  // c: factors of r^2 (m), r^4 (m), depth r^2; r is 1 in corners
  double scale = 1.0;              // factor of the sum of depth and offset

  // Basis functions at a depth and radius: four factors of the spline coefficients from index
  // `first` on, and three factors of `radial`.
  struct Terms {
    std::size_t first = 0;
    std::array<double, 4> spline{};
    std::array<double, 3> radial{};
  };

  bool empty() const { return spline_m.empty() && scale == 1.0; }
  double last_m() const { return first_m + step_m * (static_cast<double>(spline_m.size()) - 3.0); }
  // Returns the basis functions; `radius2` is squared_image_radius of the pixel. Needs a spline.
  Terms terms(double depth_m, double radius2) const;
  // Returns corrected depth minus `depth_m`, m.
  double at(double depth_m, double radius2) const;
  // Returns scale * offset, m.
  double bend(double depth_m, double radius2) const {
    return at(depth_m, radius2) - (scale - 1.0) * depth_m;
  }
  // Throws Error naming the field unless scale is from 0.5 to 2. With a spline, also unless there
  // are 4 to 1000 coefficients, step_m > 0, and coefficients and radial factors are from -1 to 1.
  void check() const;
  bool operator==(const DepthCorrection&) const = default;
};

// Returns the squared distance of a pixel from the image center, 1 at the corner pixels.
double squared_image_radius(int width, int height, double x_px, double y_px);

// Corrects a depth image, m. Pixels with depth 0 (no measurement) are not changed.
void correct_depth(DepthImage& depth, const DepthCorrection& correction);

// Registers a depth image of `camera` to the pixels of `target`. Each measurement covers the pixels
// of `target` inside the projected pixel of `camera`; the smallest depth is kept. Pixels of
// `target` without a measurement have depth 0.
DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera);

}  // namespace libmap
