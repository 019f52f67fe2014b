#include "libmap/camera/depth_correction.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr std::size_t max_coefficients = 1000;
constexpr double max_correction_m = 1.0;

}  // namespace

DepthCorrection::Terms DepthCorrection::terms(double depth_m, double radius2) const {
  Terms terms;
  const double pieces = static_cast<double>(spline_m.size()) - 3.0;
  const double within_m = std::clamp(depth_m, first_m, last_m());
  terms.radial = {radius2, radius2 * radius2, within_m * radius2};
  const double scaled = std::clamp((depth_m - first_m) / step_m, 0.0, pieces);
  const double piece = std::min(std::floor(scaled), pieces - 1.0);
  const double t = scaled - piece;
  const double s = 1.0 - t;
  terms.first = static_cast<std::size_t>(piece);
  terms.spline = {s * s * s / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
                  (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, t * t * t / 6.0};
  return terms;
}

double DepthCorrection::at(double depth_m, double radius2) const {
  const double rescaled = (scale - 1.0) * depth_m;
  if (spline_m.empty()) return rescaled;
  const Terms of = terms(depth_m, radius2);
  double sum = 0.0;
  for (std::size_t n = 0; n < 4; ++n) sum += of.spline[n] * spline_m[of.first + n];
  for (std::size_t n = 0; n < 3; ++n) sum += of.radial[n] * radial[n];
  return scale * sum + rescaled;
}

void DepthCorrection::check() const {
  if (!(scale >= 0.5 && scale <= 2.0))
    throw Error("out of range",
                {.field = "depth_scale", .value = to_text(scale), .bound = "0.5 to 2"});
  if (spline_m.empty()) return;
  if (spline_m.size() < 4 || spline_m.size() > max_coefficients)
    throw Error("wrong number of coefficients", {.field = "depth_correction",
                                                 .value = std::to_string(spline_m.size()),
                                                 .bound = "4 to 1000"});
  if (!(step_m > 0.0 && std::isfinite(step_m) && std::isfinite(first_m)))
    throw Error("out of range", {.field = "depth_correction_range",
                                 .value = to_text(first_m) + ", " + to_text(step_m),
                                 .bound = "a finite first depth, and a step > 0"});
  const auto is_small = [](double number) { return std::abs(number) <= max_correction_m; };
  for (const double number : spline_m)
    if (!is_small(number))
      throw Error("out of range",
                  {.field = "depth_correction", .value = to_text(number), .bound = "-1 to 1 m"});
  for (const double number : radial)
    if (!is_small(number))
      throw Error(
          "out of range",
          {.field = "depth_correction_radial", .value = to_text(number), .bound = "-1 to 1"});
}

double squared_image_radius(int width, int height, double x_px, double y_px) {
  const double half_x = 0.5 * (width - 1);
  const double half_y = 0.5 * (height - 1);
  const double largest = std::max(half_x * half_x + half_y * half_y, 1e-9);
  return ((x_px - half_x) * (x_px - half_x) + (y_px - half_y) * (y_px - half_y)) / largest;
}

void correct_depth(DepthImage& depth, const DepthCorrection& correction) {
  if (correction.empty()) return;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      float& z = depth.at(x, y);
      if (!(z > 0.0F)) continue;
      const auto measured = static_cast<double>(z);
      const double corrected =
          measured + correction.at(measured, squared_image_radius(depth.width, depth.height, x, y));
      z = static_cast<float>(std::max(corrected, 0.0));
    }
}

namespace {

// Pixels whose centers are inside a projected pixel; may be empty.
struct PixelBox {
  int left = 0;
  int top = 0;
  int right = -1;
  int bottom = -1;
};

PixelBox covered_pixels(const Camera& camera, const Camera& target, const Pose& target_from_camera,
                        const Eigen::Vector2d& pixel, double depth_m) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Eigen::Array2d low(infinity, infinity);
  Eigen::Array2d high = -low;
  for (const double shift : {-0.5, 0.5}) {
    const auto ray =
        pixel_to_ray(camera, Eigen::Vector2d(pixel + Eigen::Vector2d::Constant(shift)));
    if (!ray) return {};
    const auto seen = project_point(target, target_from_camera * (depth_m * ray->homogeneous()));
    if (!seen) return {};
    low = low.min(seen->array());
    high = high.max(seen->array());
  }
  if (!(high >= 0.0).all() || !(low.x() < target.width) || !(low.y() < target.height)) return {};
  return {std::max(0, static_cast<int>(std::ceil(low.x()))),
          std::max(0, static_cast<int>(std::ceil(low.y()))),
          static_cast<int>(std::min(std::floor(high.x()), target.width - 1.0)),
          static_cast<int>(std::min(std::floor(high.y()), target.height - 1.0))};
}

}  // namespace

DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera) {
  DepthImage registered(target.width, target.height);
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const auto z = static_cast<double>(depth.at(x, y));
      const auto ray = pixel_to_ray(camera, Eigen::Vector2d(x, y));
      if (!(z > 0.0) || !ray) continue;
      const double seen_z = (target_from_camera * Eigen::Vector3d(z * ray->homogeneous())).z();
      if (!(seen_z > 0.0)) continue;
      const PixelBox box = covered_pixels(camera, target, target_from_camera, {x, y}, z);
      for (int row = box.top; row <= box.bottom; ++row)
        for (int column = box.left; column <= box.right; ++column) {
          float& there = registered.at(column, row);
          if (there == 0.0F || seen_z < static_cast<double>(there))
            there = static_cast<float>(seen_z);
        }
    }
  return registered;
}

}  // namespace libmap
