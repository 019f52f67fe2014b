// Residuals of observations by poses, points and cameras. Inner part of libmap/refine.
#pragma once

#include <Eigen/Core>

#include "libmap/image/depth_correction.h"
#include "libmap/refine/frame_calibration.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

// What the calibration of its camera changes in one observation, linear about a calibration that is
// known already.
struct CalibratedObservation {
  bool intrinsics = false;  // which of the camera's numbers are unknown
  bool depth = false;
  bool registration = false;
  bool timing = false;
  DepthCorrection::Terms terms{};
  bool knows_depth = true;
  double added_m = 0.0;                    // to the depth, by the known registration and timing
  Vector6d by_step = Vector6d::Zero();     // of the depth, by a step of the registration
  Vector6d known_step = Vector6d::Zero();  // of the known timing
  double row_share = 0.0;                  // row_share_of
};

// Numbers of a camera: a step of the intrinsics (4), one of the registration (6), its timing (2),
// the radial ones of its depth correction (3), and then those of its spline.
inline constexpr Eigen::Index intrinsics_at = 0;
inline constexpr Eigen::Index registration_at = 4;
inline constexpr Eigen::Index timing_at = 10;
inline constexpr Eigen::Index radial_at = 12;
inline constexpr Eigen::Index spline_at = 15;

// x, y in the picture and depth, in standard deviations, with their derivatives.
struct CalibratedResidual {
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 6> by_pose;    // by a step of it (rigid_motion.h)
  Eigen::Matrix<double, 3, 6> by_motion;  // with timing only
  Eigen::Matrix3d by_point;
  Eigen::Matrix<double, 3, spline_at> by_camera;  // 0 where a number is known
  Eigen::RowVector4d depth_by_spline;             // from spline_at + terms.first on
};

// One observation. The intrinsics are steps away from those by which the feature's ray was made: of
// fx and fy in parts, of cx and cy in pixels; the registration is a step from the known one.
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
                1.0 / static_cast<double>(calibrated.knows_depth ? feature.depth_noise_m
                                                                 : unknown_depth_m)),
        calibrated_(calibrated) {}

  const CalibratedObservation& calibrated() const { return calibrated_; }
  // Seen from the pose, the base moving there by `motion`, by the numbers of its camera. False for
  // a point that is not in front of the camera. The derivatives only if asked for.
  bool evaluate(const Pose& map_from_base, const Vector6d& motion, const double* numbers,
                const Eigen::Vector3d& point, CalibratedResidual& result,
                bool with_derivatives) const;

 private:
  Eigen::Matrix3d camera_from_base_;
  Eigen::Vector3d base_from_camera_;  // the camera's place
  Eigen::Vector2d ray_;
  double depth_;
  Eigen::Vector2d focal_;
  Eigen::Vector3d weight_;
  CalibratedObservation calibrated_;
};

// Residual of an observation with its derivatives by a step of the pose and by the point.
struct Linearized {
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6> by_pose;
  Eigen::Matrix3d by_point;
};

inline Linearized linearize(const Feature& feature, const Camera& camera, const Pose& map_from_base,
                            const Eigen::Vector3d& point) {
  const Pose camera_from_base = camera.base_from_camera.inverse();
  const Eigen::Vector3d in_base = map_from_base.inverse() * point;
  const Eigen::Vector3d p = camera_from_base * in_base;
  Eigen::Matrix3d projection;
  projection << camera.fx / p.z(), 0.0, -camera.fx * p.x() / (p.z() * p.z()), 0.0,
      camera.fy / p.z(), -camera.fy * p.y() / (p.z() * p.z()), 0.0, 0.0, 1.0;
  const double pixel = 1.0 / static_cast<double>(feature.pixel_noise_px);
  const double depth = 1.0 / static_cast<double>(feature.depth_noise_m);
  const Eigen::Vector3d weight(pixel, pixel, depth);
  const Eigen::Matrix3d by_base = weight.asDiagonal() * projection * camera_from_base.linear();
  Linearized result;
  result.residual = weight.cwiseProduct(
      Eigen::Vector3d(camera.fx * (p.x() / p.z() - static_cast<double>(feature.ray.x())),
                      camera.fy * (p.y() / p.z() - static_cast<double>(feature.ray.y())),
                      p.z() - static_cast<double>(feature.depth_m)));
  // A step of the pose moves the point against it: d in_base = -t + [in_base]x r.
  result.by_pose.leftCols<3>() = -by_base;
  result.by_pose.rightCols<3>() = by_base * cross_matrix(in_base);
  result.by_point = by_base * map_from_base.linear().transpose();
  return result;
}

}  // namespace libmap
