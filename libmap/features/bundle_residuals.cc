#include "libmap/features/bundle_residuals.h"

namespace libmap {

namespace {

// First-order effect of the base's motion on an observation.
struct Moving {
  double time_s = 0.0;   // time of the row
  double later_s = 0.0;  // delay of the depth relative to the row
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Vector6d depth_by_motion = Vector6d::Zero();  // per second of motion
  double added_by_time = 0.0;
};

}  // namespace

Projection project(const Eigen::Vector3d& point, const Eigen::Vector2d& focal_px,
                   const Eigen::Vector2d& ray, double depth_m) {
  const Eigen::Vector2d seen = point.hnormalized();
  const Eigen::Vector2d scale = focal_px / point.z();
  Projection projection;
  projection.residual << focal_px.cwiseProduct(seen - ray), point.z() - depth_m;
  projection.by_point << scale.x(), 0.0, -scale.x() * seen.x(),  //
      0.0, scale.y(), -scale.y() * seen.y(),                     //
      0.0, 0.0, 1.0;
  return projection;
}

bool CalibratedFeature::evaluate(const Pose& map_from_base, const Vector6d& motion,
                                 const double* camera_params, const Eigen::Vector3d& point,
                                 CalibratedResidual& result, bool with_derivatives) const {
  const Eigen::Matrix3d base_from_map = map_from_base.linear().transpose();
  const Eigen::Vector3d in_base = base_from_map * (point - map_from_base.translation());
  // Position of the base when the row is exposed.
  Moving moving;
  Eigen::Matrix3d by_base = camera_from_base_;
  double added = calibrated_.added_m;
  if (calibrated_.timing) {
    moving.time_s = camera_params[timing_at + 1] * calibrated_.image_row_fraction;
    moving.later_s = camera_params[timing_at] + calibrated_.depth_stamp_offset_s - moving.time_s;
    moving.velocity = motion.head<3>() + motion.tail<3>().cross(in_base);
    by_base -= moving.time_s * camera_from_base_ * cross_matrix(motion.tail<3>());
    // Registration step caused by a motion: motion_in_camera, transposed.
    const Eigen::Vector3d shift = camera_from_base_.transpose() * calibrated_.by_step.head<3>();
    moving.depth_by_motion << shift, camera_from_base_.transpose() * calibrated_.by_step.tail<3>() +
                                         base_from_camera_.cross(shift);
    moving.added_by_time = moving.depth_by_motion.dot(motion);
    added +=
        moving.later_s * moving.added_by_time - calibrated_.by_step.dot(calibrated_.known_step);
  }
  const Eigen::Vector3d p =
      camera_from_base_ * (in_base - moving.time_s * moving.velocity - base_from_camera_);
  if (!(p.z() > 1e-3)) return false;
  if (calibrated_.depth) {
    const double* const spline = camera_params + spline_at + calibrated_.terms.first;
    for (std::size_t n = 0; n < 4; ++n) added += spline[n] * calibrated_.terms.spline[n];
    for (std::size_t n = 0; n < 3; ++n)
      added +=
          camera_params[radial_at + static_cast<Eigen::Index>(n)] * calibrated_.terms.radial[n];
  }
  if (calibrated_.registration)
    added += calibrated_.by_step.dot(Eigen::Map<const Vector6d>(camera_params + registration_at));
  Eigen::Vector2d focal = focal_;
  if (calibrated_.intrinsics)
    focal = focal_.cwiseProduct(Eigen::Vector2d(1.0 + camera_params[intrinsics_at],
                                                1.0 + camera_params[intrinsics_at + 1]));
  const Projection projection = project(p, focal, ray_, depth_ + added);
  Eigen::Vector3d error = projection.residual;
  if (calibrated_.intrinsics)
    error.head<2>() += (focal - focal_).cwiseProduct(ray_) +
                       Eigen::Map<const Eigen::Vector2d>(camera_params + intrinsics_at + 2);
  result.residual = weight_.cwiseProduct(error);
  if (!with_derivatives) return true;

  const Eigen::Matrix3d by_camera = weight_.asDiagonal() * projection.by_point;
  const Eigen::Matrix3d by_base_point = by_camera * by_base;
  // A step of the pose moves the point against it: d in_base = -t + [in_base]x r.
  result.by_pose.leftCols<3>() = -by_base_point;
  result.by_pose.rightCols<3>() = by_base_point * cross_matrix(in_base);
  result.by_point = by_base_point * base_from_map;
  result.by_camera.setZero();
  if (calibrated_.intrinsics) {
    const Eigen::Vector2d seen = p.hnormalized();
    result.by_camera(0, intrinsics_at) = weight_.x() * focal_.x() * seen.x();
    result.by_camera(1, intrinsics_at + 1) = weight_.y() * focal_.y() * seen.y();
    result.by_camera(0, intrinsics_at + 2) = weight_.x();
    result.by_camera(1, intrinsics_at + 3) = weight_.y();
  }
  if (calibrated_.depth) {
    result.depth_by_spline =
        -weight_.z() * Eigen::Map<const Eigen::RowVector4d>(calibrated_.terms.spline.data());
    result.by_camera.block<1, 3>(2, radial_at) =
        -weight_.z() * Eigen::Map<const Eigen::RowVector3d>(calibrated_.terms.radial.data());
  }
  if (calibrated_.registration)
    result.by_camera.block<1, 6>(2, registration_at) =
        -weight_.z() * calibrated_.by_step.transpose();
  if (!calibrated_.timing) return true;
  result.by_motion.leftCols<3>() = -moving.time_s * by_camera * camera_from_base_;
  result.by_motion.rightCols<3>() =
      moving.time_s * by_camera * camera_from_base_ * cross_matrix(in_base);
  result.by_motion.row(2) -= weight_.z() * moving.later_s * moving.depth_by_motion.transpose();
  const Eigen::Vector3d by_delay(0.0, 0.0, -weight_.z() * moving.added_by_time);
  result.by_camera.col(timing_at) = by_delay;
  result.by_camera.col(timing_at + 1) =
      -calibrated_.image_row_fraction *
      (by_camera * (camera_from_base_ * moving.velocity) + by_delay);
  return true;
}

}  // namespace libmap
