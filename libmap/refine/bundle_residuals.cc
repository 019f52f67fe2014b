#include "libmap/refine/bundle_residuals.h"

#include <algorithm>
#include <array>

namespace libmap {

namespace {

template <int columns>
using Jacobian = Eigen::Matrix<double, 3, columns, Eigen::RowMajor>;

// Of the rotation of a point of the map into the base, by the four numbers of its quaternion: for
// steps on the sphere of unit quaternions, as Ceres' EigenQuaternionManifold takes them.
Eigen::Matrix<double, 3, 4> by_quaternion(const Eigen::Quaterniond& q,
                                          const Eigen::Matrix3d& by_turn) {
  Eigen::Matrix<double, 4, 3> step;
  step << q.w(), q.z(), -q.y(), -q.z(), q.w(), q.x(), q.y(), -q.x(), q.w(), -q.x(), -q.y(), -q.z();
  return 2.0 * by_turn * step.transpose();
}

}  // namespace

bool ObservationCost::Evaluate(const double* const* blocks, double* residual,
                               double** jacobians) const {
  std::size_t next = 2;
  const double* const intrinsics = calibrated_.intrinsics ? blocks[next++] : nullptr;
  const std::size_t depth = next;
  if (calibrated_.depth) next += 5;
  const std::size_t registration = next;
  if (calibrated_.registration) ++next;
  const std::size_t timing = next;

  const PoseView<double> base(blocks[0]);
  const Eigen::Matrix3d base_from_map = base.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d from_base = Eigen::Map<const Eigen::Vector3d>(blocks[1]) - base.translation;
  const Eigen::Vector3d in_base = base_from_map * from_base;
  // Where the base is when the row is exposed, to first order.
  double time_s = 0.0;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Matrix3d by_base = camera_from_base_;
  Vector6d depth_by_motion = Vector6d::Zero();
  double added = calibrated_.added_m;
  double later_s = 0.0;
  double added_by_time = 0.0;
  if (calibrated_.timing) {
    const Eigen::Map<const Vector6d> motion(blocks[timing]);
    time_s = blocks[timing + 1][1] * calibrated_.row_share;
    later_s = blocks[timing + 1][0] - time_s;
    velocity = motion.head<3>() + motion.tail<3>().cross(in_base);
    by_base -= time_s * camera_from_base_ * cross_matrix(motion.tail<3>());
    // The step of the registration that a motion makes: motion_in_camera, transposed.
    const Eigen::Vector3d shift = camera_from_base_.transpose() * calibrated_.by_step.head<3>();
    depth_by_motion << shift, camera_from_base_.transpose() * calibrated_.by_step.tail<3>() +
                                  base_from_camera_.cross(shift);
    added_by_time = depth_by_motion.dot(motion);
    added += later_s * added_by_time - calibrated_.by_step.dot(calibrated_.known_step);
  }
  const Eigen::Vector3d p = camera_from_base_ * (in_base - time_s * velocity - base_from_camera_);
  if (p.z() < 1e-3) return false;
  if (calibrated_.depth) {
    for (std::size_t n = 0; n < 4; ++n) added += blocks[depth + n][0] * calibrated_.terms.spline[n];
    for (std::size_t n = 0; n < 3; ++n) added += blocks[depth + 4][n] * calibrated_.terms.radial[n];
  }
  if (calibrated_.registration)
    added += calibrated_.by_step.dot(Eigen::Map<const Vector6d>(blocks[registration]));
  const Eigen::Vector2d seen = p.hnormalized();
  Eigen::Vector2d focal = focal_;
  Eigen::Vector3d error(-focal_.x() * ray_.x(), -focal_.y() * ray_.y(), p.z() - depth_ - added);
  if (intrinsics != nullptr) {
    focal.x() *= 1.0 + intrinsics[0];
    focal.y() *= 1.0 + intrinsics[1];
    error.head<2>() += Eigen::Vector2d(intrinsics[2], intrinsics[3]);
  }
  error.head<2>() += focal.cwiseProduct(seen);
  Eigen::Map<Eigen::Vector3d> out(residual);
  out = weight_.cwiseProduct(error);
  if (jacobians == nullptr) return true;

  Eigen::Matrix3d by_camera;
  by_camera << focal.x() / p.z(), 0.0, -focal.x() * seen.x() / p.z(),  //
      0.0, focal.y() / p.z(), -focal.y() * seen.y() / p.z(),           //
      0.0, 0.0, 1.0;
  by_camera = weight_.asDiagonal() * by_camera;
  const Eigen::Matrix3d by_point = by_camera * by_base * base_from_map;
  if (jacobians[0] != nullptr) {
    Eigen::Map<Jacobian<7>> by_pose(jacobians[0]);
    by_pose.leftCols<4>() = by_quaternion(base.rotation, by_point * cross_matrix(from_base));
    by_pose.rightCols<3>() = -by_point;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Jacobian<3>> out_by_point(jacobians[1]);
    out_by_point = by_point;
  }
  if (intrinsics != nullptr && jacobians[2] != nullptr) {
    Eigen::Map<Jacobian<4>> by_intrinsics(jacobians[2]);
    by_intrinsics.setZero();
    by_intrinsics(0, 0) = weight_.x() * focal_.x() * seen.x();
    by_intrinsics(1, 1) = weight_.y() * focal_.y() * seen.y();
    by_intrinsics(0, 2) = weight_.x();
    by_intrinsics(1, 3) = weight_.y();
  }
  if (calibrated_.depth) {
    for (std::size_t n = 0; n < 4; ++n)
      if (double* const by_number = jacobians[depth + n]; by_number != nullptr)
        std::copy_n(std::array{0.0, 0.0, -weight_.z() * calibrated_.terms.spline[n]}.begin(), 3,
                    by_number);
    if (double* const by_radial = jacobians[depth + 4]; by_radial != nullptr) {
      Eigen::Map<Jacobian<3>> radial(by_radial);
      radial.setZero();
      for (Eigen::Index n = 0; n < 3; ++n)
        radial(2, n) = -weight_.z() * calibrated_.terms.radial[static_cast<std::size_t>(n)];
    }
  }
  if (calibrated_.registration && jacobians[registration] != nullptr) {
    Eigen::Map<Jacobian<6>> by_registration(jacobians[registration]);
    by_registration.setZero();
    by_registration.row(2) = -weight_.z() * calibrated_.by_step.transpose();
  }
  if (!calibrated_.timing) return true;
  if (jacobians[timing] != nullptr) {
    Eigen::Map<Jacobian<6>> by_motion(jacobians[timing]);
    by_motion.leftCols<3>() = -time_s * by_camera * camera_from_base_;
    by_motion.rightCols<3>() = time_s * by_camera * camera_from_base_ * cross_matrix(in_base);
    by_motion.row(2) -= weight_.z() * later_s * depth_by_motion.transpose();
  }
  if (jacobians[timing + 1] != nullptr) {
    Eigen::Map<Jacobian<2>> by_time(jacobians[timing + 1]);
    by_time.col(0) = Eigen::Vector3d(0.0, 0.0, -weight_.z() * added_by_time);
    by_time.col(1) =
        -calibrated_.row_share * (by_camera * (camera_from_base_ * velocity) + by_time.col(0));
  }
  return true;
}

}  // namespace libmap
