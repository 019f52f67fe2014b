// Pinhole cameras with lens distortion.
//
// The camera's optical frame has z forward, x right, y down (REP-103); pixel centers have whole
// coordinates: u = fx * x/z + cx, v = fy * y/z + cy.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libmap/core/pose.h"

namespace libmap {

// radial_tangential: OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]] (Brown 1966 with a rational
// radial part and thin prisms). equidistant: OpenCV's fisheye k1..k4 (Kannala and Brandt 2006).
enum class DistortionModel { none, radial_tangential, equidistant };

// x forward, y left, z up from an optical frame.
Pose optical_to_body_rotation();

struct Camera {
  int width = 0;  // pixels
  int height = 0;
  double fx = 0.0;  // pixels
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  DistortionModel distortion_model = DistortionModel::none;
  std::vector<double> distortion{};  // 4, 5, 8 or 12 numbers; 4 where equidistant
  Pose base_from_camera = optical_to_body_rotation();

  bool is_distorted() const;  // whether any term of the distortion is not 0
  // Throws Error naming the field, its value and its bound: sizes > 0, focal lengths of 1e-6 to
  // 1e9 pixels, a principal point within 1e9 of them, a known number of distortion terms up to
  // 1e12, a position within 1e8 m.
  void check() const;
};

// The same camera without its distortion.
Camera without_distortion(Camera camera);

// x/z, y/z -> pixel, distortion included; and back (Newton's method, to 1e-9 of a focal length).
// unproject gives nothing where no ray belongs to the pixel.
Eigen::Vector2d distort_to_pixel(const Camera& camera, const Eigen::Vector2d& ray);
std::optional<Eigen::Vector2d> pixel_to_ray(const Camera& camera, const Eigen::Vector2d& pixel);

// The pixel of a point in the optical frame, or nothing if it lies behind the camera. The pixel may
// lie outside the image.
std::optional<Eigen::Vector2d> project_point(const Camera& camera,
                                             const Eigen::Vector3d& point_in_camera);

// x/z, y/z of every pixel's ray, row by row; NaN where no ray belongs to the pixel.
std::vector<Eigen::Vector2d> ray_table(const Camera& camera);

}  // namespace libmap
