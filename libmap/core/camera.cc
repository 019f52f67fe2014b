#include "libmap/core/camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

// Bounds far beyond all lenses. They keep rays and their products within the range of doubles.
constexpr double min_focal_px = 1e-6;
constexpr double max_pixels = 1e9;
constexpr double max_distortion = 1e12;

using Matrix2 = Eigen::Matrix2d;

struct Distorted {
  Eigen::Vector2d ray;
  Matrix2 derivative;  // of the distorted ray with respect to the undistorted ray
};

// OpenCV's model with 4, 5, 8 or 12 coefficients; missing ones are 0. Few calls need a derivative.
template <bool with_derivative>
Distorted distort_radial_tangential(const std::vector<double>& terms, const Eigen::Vector2d& ray) {
  std::array<double, 12> k{};
  std::copy_n(terms.begin(), std::min(terms.size(), k.size()), k.begin());
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double top = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double bottom = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double radial = top / bottom;
  const double p1 = k[2];
  const double p2 = k[3];
  Distorted out;
  out.ray.x() = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (k[8] + r2 * k[9]);
  out.ray.y() = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (k[10] + r2 * k[11]);
  if (!with_derivative) return out;
  const double top_slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
  const double bottom_slope = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
  const double slope = (top_slope - radial * bottom_slope) / bottom;  // of radial by r2
  const double prism_x = 2 * (k[8] + 2 * r2 * k[9]);
  const double prism_y = 2 * (k[10] + 2 * r2 * k[11]);
  const double cross = 2 * x * y * slope;
  out.derivative << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + prism_x * x,
      cross + 2 * p1 * x + 2 * p2 * y + prism_x * y, cross + 2 * p1 * x + 2 * p2 * y + prism_y * x,
      radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + prism_y * y;
  return out;
}

// Kannala and Brandt 2006: the distorted radius is a polynomial of the angle from the axis.
Distorted distort_equidistant(const std::vector<double>& terms, const Eigen::Vector2d& ray) {
  std::array<double, 4> k{};
  std::copy_n(terms.begin(), std::min(terms.size(), k.size()), k.begin());
  const double r = ray.norm();
  if (r < 1e-9) return {ray, Matrix2::Identity()};
  const double angle = std::atan(r);
  const double a2 = angle * angle;
  const double radius = angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
  const double radius_slope =
      (1 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])))) / (1 + r * r);
  const Eigen::Vector2d unit = ray / r;
  const double scale = radius / r;
  return {ray * scale,
          scale * Matrix2::Identity() + (radius_slope - scale) * (unit * unit.transpose())};
}

template <bool with_derivative>
Distorted distort(const Camera& camera, const Eigen::Vector2d& ray) {
  if (!camera.is_distorted()) return {ray, Matrix2::Identity()};
  return camera.distortion_model == DistortionModel::equidistant
             ? distort_equidistant(camera.distortion, ray)
             : distort_radial_tangential<with_derivative>(camera.distortion, ray);
}

[[noreturn]] void refuse(const std::string& field, double value, const std::string& bound) {
  throw Error("invalid camera", {.field = field, .value = to_text(value), .bound = bound});
}

}  // namespace

Pose optical_to_body_rotation() {
  Pose body_from_optical = Pose::Identity();
  body_from_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return body_from_optical;
}

bool Camera::is_distorted() const {
  // An equidistant lens with zero coefficients is not a pinhole either.
  if (distortion_model == DistortionModel::equidistant) return true;
  return distortion_model != DistortionModel::none &&
         std::any_of(distortion.begin(), distortion.end(), [](double term) { return term != 0.0; });
}

void Camera::check() const {
  if (width <= 0) refuse("width", width, "> 0");
  if (height <= 0) refuse("height", height, "> 0");
  const auto require_within = [](const char* field, double value, double low, double high) {
    if (!(value >= low && value <= high))
      refuse(field, value, to_text(low) + " to " + to_text(high));
  };
  require_within("fx", fx, min_focal_px, max_pixels);
  require_within("fy", fy, min_focal_px, max_pixels);
  require_within("cx", cx, -max_pixels, max_pixels);
  require_within("cy", cy, -max_pixels, max_pixels);
  for (const double term : distortion)
    require_within("distortion", term, -max_distortion, max_distortion);
  for (const double number : base_from_camera.matrix().reshaped())
    require_within("base_from_camera", number, -max_position_m, max_position_m);
  const std::size_t n = distortion.size();
  if (distortion_model == DistortionModel::equidistant && n != 4)
    refuse("number of distortion terms", static_cast<double>(n), "4");
  if (distortion_model == DistortionModel::radial_tangential && n != 4 && n != 5 && n != 8 &&
      n != 12)
    refuse("number of distortion terms", static_cast<double>(n), "4, 5, 8 or 12");
}

Camera without_distortion(Camera camera) {
  camera.distortion_model = DistortionModel::none;
  camera.distortion.clear();
  return camera;
}

Eigen::Vector2d distort_to_pixel(const Camera& camera, const Eigen::Vector2d& ray) {
  const Eigen::Vector2d bent = distort<false>(camera, ray).ray;
  return {camera.fx * bent.x() + camera.cx, camera.fy * bent.y() + camera.cy};
}

std::optional<Eigen::Vector2d> pixel_to_ray(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d wanted((pixel.x() - camera.cx) / camera.fx,
                               (pixel.y() - camera.cy) / camera.fy);
  if (!camera.is_distorted()) return wanted;
  Eigen::Vector2d ray = wanted;
  if (camera.distortion_model == DistortionModel::equidistant) {
    // The distorted radius is close to the angle from the axis.
    const double angle = wanted.norm();
    if (angle >= 1.57) return std::nullopt;
    if (angle > 0) ray = wanted * (std::tan(angle) / angle);
  }
  for (int step = 0; step < 50; ++step) {
    const Distorted at = distort<true>(camera, ray);
    const Eigen::Vector2d miss = at.ray - wanted;
    if (!miss.allFinite()) return std::nullopt;
    // Beyond the fold of the polynomial, a second ray has the same pixel.
    if (at.derivative.determinant() <= 0) return std::nullopt;
    if (miss.norm() <= 1e-12 * (1 + wanted.norm())) return ray;
    const Eigen::Vector2d move = at.derivative.inverse() * miss;
    const double limit = 0.5 * (1 + ray.norm());
    ray -= move.norm() > limit ? Eigen::Vector2d(move * (limit / move.norm())) : move;
  }
  if ((distort<false>(camera, ray).ray - wanted).norm() <= 1e-9) return ray;
  return std::nullopt;
}

std::optional<Eigen::Vector2d> project_point(const Camera& camera,
                                             const Eigen::Vector3d& point_in_camera) {
  if (!(point_in_camera.z() > 0)) return std::nullopt;
  return distort_to_pixel(camera, Eigen::Vector2d(point_in_camera.x() / point_in_camera.z(),
                                                  point_in_camera.y() / point_in_camera.z()));
}

std::vector<Eigen::Vector2d> ray_table(const Camera& camera) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector2d> rays;
  rays.reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      rays.push_back(
          pixel_to_ray(camera, Eigen::Vector2d(x, y)).value_or(Eigen::Vector2d(nan, nan)));
  return rays;
}

}  // namespace libmap
