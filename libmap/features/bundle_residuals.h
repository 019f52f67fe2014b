// Residuals of bundle adjustment, with derivatives by (with respect to) poses, points and cameras.
#pragma once

#include <Eigen/Core>

#include "libmap/camera/depth_correction.h"
#include "libmap/features/frame_calibration.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

// Residual of a point (x, y, z) (camera's optical frame, m) that was measured on the ray (u, v, 1)
// at a depth d. z must not be 0.
struct Projection {
  Eigen::Vector3d residual;  // fx (x/z - u) px, fy (y/z - v) px, z - d m
  Eigen::Matrix3d by_point;  // derivative by the point
};
Projection project(const Eigen::Vector3d& point, const Eigen::Vector2d& focal_px,
                   const Eigen::Vector2d& ray, double depth_m);

// Effect of camera calibration on one observation, linearized at a known calibration. The first
// four fields are true if the camera's parameters of this kind are estimated.
struct CalibratedObservation {
  bool intrinsics = false;                 // focal lengths and principal point
  bool depth = false;                      // DepthCorrection
  bool registration = false;               // pose of the depth camera relative to the color camera
  bool timing = false;                     // CameraTiming
  DepthCorrection::Terms terms{};          // basis values of the depth correction at the feature
  bool has_depth = true;                   // false: depth unknown (RegisteredDepth::known)
  double added_m = 0.0;                    // change of depth by the known registration and timing
  Vector6d by_step = Vector6d::Zero();     // derivative of the depth by a registration step
  Vector6d known_step = Vector6d::Zero();  // registration step due to known timing and motion
  double image_row_fraction = 0.0;         // row_fraction() of the feature (frame_calibration.h)
  double depth_stamp_offset_s = 0.0;       // FrameFeatures::depth_stamp_offset_s
};

// First index of each kind of a camera's parameters: 4 for a step of intrinsics, 6 for a step of
// registration, 2 for timing; for the depth correction, 3 radial terms, then spline coefficients.
inline constexpr Eigen::Index intrinsics_at = 0;
inline constexpr Eigen::Index registration_at = 4;
inline constexpr Eigen::Index timing_at = 10;
inline constexpr Eigen::Index radial_at = 12;
inline constexpr Eigen::Index spline_at = 15;

// Residual (image x, image y, depth) in standard deviations, and its derivatives.
struct CalibratedResidual {
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 6> by_pose;    // by a step of the pose (rigid_motion.h)
  Eigen::Matrix<double, 3, 6> by_motion;  // by the base's velocity; set only if timing is estimated
  Eigen::Matrix3d by_point;               // by the point in the map frame
  Eigen::Matrix<double, 3, spline_at> by_camera;  // by the parameters before spline_at; 0 if known
  Eigen::RowVector4d depth_by_spline;  // depth by the 4 parameters from spline_at + terms.first on
};

// One observation of a point. The parameters of the intrinsics are steps from the intrinsics that
// determined the feature's ray: relative for fx and fy, in pixels for cx and cy. The parameters of
// the registration are a step from the known registration.
class CalibratedFeature {
 public:
  CalibratedFeature(const Feature& feature, const Camera& camera,
                    const CalibratedObservation& calibrated)
      : camera_from_base_(camera.base_from_camera.linear().transpose()),
        base_from_camera_(camera.base_from_camera.translation()),
        ray_(feature.ray.cast<double>()),
        depth_(static_cast<double>(feature.depth_m)),
        focal_(camera.fx, camera.fy),
        weight_(1.0 / static_cast<double>(feature.pixel_noise_px),
                1.0 / static_cast<double>(feature.pixel_noise_px),
                1.0 / static_cast<double>(calibrated.has_depth ? feature.depth_noise_m
                                                               : unknown_depth_m)),
        calibrated_(calibrated) {}

  const CalibratedObservation& calibrated() const { return calibrated_; }
  // Converts a residual in standard deviations to x, y (px) and depth (m).
  Eigen::Vector3d unweighted(const Eigen::Vector3d& residual) const {
    return residual.cwiseQuotient(weight_);
  }
  // Evaluates the residual of `point` (map frame) for a base that moves by `motion` (base frame,
  // m/s and rad/s). `camera_params` starts at the camera's first parameter. Returns false if the
  // point is not in front of the camera. Derivatives are set only if `with_derivatives` is true.
  bool evaluate(const Pose& map_from_base, const Vector6d& motion, const double* camera_params,
                const Eigen::Vector3d& point, CalibratedResidual& result,
                bool with_derivatives) const;

 private:
  Eigen::Matrix3d camera_from_base_;
  Eigen::Vector3d base_from_camera_;  // position of the camera
  Eigen::Vector2d ray_;
  double depth_;
  Eigen::Vector2d focal_;
  Eigen::Vector3d weight_;
  CalibratedObservation calibrated_;
};

}  // namespace libmap
