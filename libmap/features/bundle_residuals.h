// Residuals of observations by poses, points and cameras.
#pragma once

#include <Eigen/Core>

#include "libmap/camera/depth_correction.h"
#include "libmap/features/frame_calibration.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

// fx (x/z - u) and fy (y/z - v), px, and z - depth, m, of a point in a camera's frame that was seen
// along the ray (u, v).
struct Projection {
  Eigen::Vector3d residual;
  Eigen::Matrix3d by_point;
};
Projection project(const Eigen::Vector3d& point, const Eigen::Vector2d& focal_px,
                   const Eigen::Vector2d& ray, double depth_m);

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
  double depth_later_s = 0.0;              // FrameFeatures::depth_later_s
};

// Parameters of a camera: a step of the intrinsics (4), one of the registration (6), its timing
// (2), the radial ones of its depth correction (3), and then those of its spline.
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
  // x and y, px, and depth, m, of a residual in standard deviations.
  Eigen::Vector3d unweighted(const Eigen::Vector3d& residual) const {
    return residual.cwiseQuotient(weight_);
  }
  // Seen from the pose, the base moving there by `motion`, by the parameters of its camera. False
  // for a point that is not in front of the camera. The derivatives only if asked for.
  bool evaluate(const Pose& map_from_base, const Vector6d& motion, const double* camera_params,
                const Eigen::Vector3d& point, CalibratedResidual& result,
                bool with_derivatives) const;

 private:
  Eigen::Matrix3d camera_from_base_;
  Eigen::Vector3d base_from_camera_;  // the camera's position
  Eigen::Vector2d ray_;
  double depth_;
  Eigen::Vector2d focal_;
  Eigen::Vector3d weight_;
  CalibratedObservation calibrated_;
};

}  // namespace libmap
