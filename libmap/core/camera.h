// Pinhole cameras with lens distortion.
//
// The camera's optical frame has z forward, x right, y down (REP-103); pixel centers have whole
// coordinates. Without distortion, u = fx * x/z + cx and v = fy * y/z + cy.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libmap/core/pose.h"

namespace libmap {

// radial_tangential: OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]] (Brown 1966 with a rational
// radial part and thin prisms). equidistant: OpenCV's fisheye k1..k4 (Kannala and Brandt 2006).
enum class DistortionModel { none, radial_tangential, equidistant };

// Returns the rotation from the optical frame to a body frame (x forward, y left, z up).
Pose optical_to_body_rotation();

struct Camera {
  int width = 0;  // pixels
  int height = 0;
  double fx = 0.0;  // focal lengths, pixels
  double fy = 0.0;
  double cx = 0.0;  // principal point, pixels
  double cy = 0.0;
  DistortionModel distortion_model = DistortionModel::none;
  std::vector<double> distortion{};  // 4, 5, 8 or 12 coefficients; equidistant: 4; none: unused
  Pose base_from_camera = optical_to_body_rotation();  // optical frame in the robot's base frame

  // True if the model is equidistant, or radial_tangential with a coefficient other than 0.
  bool is_distorted() const;
  // Throws Error naming field, value and bound if a value is invalid. Valid are: size > 0, focal
  // lengths 1e-6 to 1e9 px, |cx|, |cy| <= 1e9 px, |coefficients| <= 1e12, |position| <= 1e8 m.
  void check() const;
};

Camera without_distortion(Camera camera);  // with the model `none` and no coefficients

// Returns the distorted pixel position of the ray (x/z, y/z) in the optical frame.
Eigen::Vector2d distort_to_pixel(const Camera& camera, const Eigen::Vector2d& ray);
// Inverse of distort_to_pixel by Newton's method (tolerance: 1e-9); nullopt if no ray is found.
std::optional<Eigen::Vector2d> pixel_to_ray(const Camera& camera, const Eigen::Vector2d& pixel);

// Returns the distorted pixel position of a point in the optical frame, m, also outside the image;
// nullopt unless z > 0.
std::optional<Eigen::Vector2d> project_point(const Camera& camera,
                                             const Eigen::Vector3d& point_in_camera);

// Returns the rays (x/z, y/z) of all pixels in row-major order; NaN if a pixel has no ray.
std::vector<Eigen::Vector2d> ray_table(const Camera& camera);

}  // namespace libmap
