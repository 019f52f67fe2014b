#include "libmap/geometry/rigid_motion.h"

#include <cmath>

namespace libmap {

Eigen::Quaterniond rotation_of(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double half = 0.5 * angle;
  const double scale = angle > 1e-8 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  Eigen::Quaterniond rotation(std::cos(half), scale * rotation_vector.x(),
                              scale * rotation_vector.y(), scale * rotation_vector.z());
  return rotation.normalized();
}

Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond q(rotation);
  if (q.w() < 0.0) q.coeffs() *= -1.0;
  const double sine = q.vec().norm();
  if (sine < 1e-9) return 2.0 * q.vec();
  return (2.0 * std::atan2(sine, q.w()) / sine) * q.vec();
}

Eigen::Matrix3d rotation_vector_derivative(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double factor =
      angle > 1e-4 ? (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / (angle * angle) : 1.0 / 12.0;
  const Eigen::Matrix3d cross = cross_matrix(rotation_vector);
  return Eigen::Matrix3d::Identity() + 0.5 * cross + factor * cross * cross;
}

Pose moved(const Pose& pose, const Vector6d& step) {
  Pose result = pose;
  result.translation() += pose.linear() * step.head<3>();
  result.linear() = (Eigen::Quaterniond(pose.linear()) * rotation_of(step.tail<3>()))
                        .normalized()
                        .toRotationMatrix();
  return result;
}

Vector6d step_between(const Pose& from, const Pose& to) {
  Vector6d step;
  step.head<3>() = from.linear().transpose() * (to.translation() - from.translation());
  step.tail<3>() = rotation_vector_of(from.linear().transpose() * to.linear());
  return step;
}

bool is_near(const Pose& a, const Pose& b, double distance_m, double angle_rad) {
  const Vector6d apart = step_between(a, b);
  return apart.head<3>().norm() <= distance_m && apart.tail<3>().norm() <= angle_rad;
}

Matrix6d step_derivative(const Pose& from, const Pose& to) {
  const Eigen::Matrix3d turn = from.linear().transpose() * to.linear();
  Matrix6d derivative = Matrix6d::Zero();
  derivative.topLeftCorner<3, 3>() = turn;
  derivative.bottomRightCorner<3, 3>() = rotation_vector_derivative(rotation_vector_of(turn));
  return derivative;
}

RelativeJacobian relative_jacobian(const Pose& a_from_b) {
  RelativeJacobian jacobian{Matrix6d::Zero(), Matrix6d::Identity()};
  const Eigen::Matrix3d b_from_a = a_from_b.linear().transpose();
  jacobian.by_a.topLeftCorner<3, 3>() = -b_from_a;
  jacobian.by_a.topRightCorner<3, 3>() = b_from_a * cross_matrix(a_from_b.translation());
  jacobian.by_a.bottomRightCorner<3, 3>() = -b_from_a;
  return jacobian;
}

}  // namespace libmap
