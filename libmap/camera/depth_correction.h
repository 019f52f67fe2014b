// Corrects systematic errors of a depth camera: adds a smooth offset that depends on depth (uniform
// cubic B-spline) and image radius, and multiplies the sum by a scale. The offset is linear in the
// coefficients, which are estimated by least squares. (Teichman et al. 2013 correct each range and
// pixel, for which a scan has too few data.) Also registers depth images to another camera.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

struct DepthCorrection {
  double first_m = 0.0;            // the offset is constant below first_m and above last_m()
  double step_m = 0.0;             // distance of the spline's knots; > 0 if there is a spline
  std::vector<double> spline_m{};  // coefficients, at least 4; empty: scale only
  std::array<double, 3> radial{};  // factors of r^2 and r^4 (m), and depth r^2; r is 1 in corners
  double scale = 1.0;              // factor of the sum of depth and offset

  // Basis functions at a depth and radius: weights of the spline coefficients from index `first`,
  // and of the radial coefficients.
  struct Terms {
    std::size_t first = 0;
    std::array<double, 4> spline{};
    std::array<double, 3> radial{};
  };

  bool empty() const { return spline_m.empty() && scale == 1.0; }
  double last_m() const { return first_m + step_m * (static_cast<double>(spline_m.size()) - 3.0); }
  // Basis functions; `radius2` is the result of squared_image_radius. Requires a spline.
  Terms terms(double depth_m, double radius2) const;
  // Corrected depth minus `depth_m`, m.
  double at(double depth_m, double radius2) const;
  // Returns `scale` times the offset: at() without the change of `depth_m` itself by the scale.
  double bend(double depth_m, double radius2) const {
    return at(depth_m, radius2) - (scale - 1.0) * depth_m;
  }
  // Throws Error naming the field unless the scale is from 0.5 to 2, and the spline is empty or has
  // 4 to 1000 coefficients and step_m > 0. Coefficients and radial factors must be from -1 to 1.
  void check() const;
  bool operator==(const DepthCorrection&) const = default;
};

// Squared distance of a pixel from the image center, 1 at the corner pixels.
double squared_image_radius(int width, int height, double x_px, double y_px);

// Corrects a depth image, m. Pixels without depth are not changed.
void correct_depth(DepthImage& depth, const DepthCorrection& correction);

// Registers a depth image of `camera` to the pixels of `target`. Each measurement covers the pixels
// of `target` inside the projected pixel; the nearest one is kept. Pixels without one have depth 0.
DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera);

}  // namespace libmap
