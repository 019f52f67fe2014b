// Small motions of poses. A pose T moves by a step e = (x y z, rotation vector) in its own frame:
// moved(T, e) = T * [exp(rotation) | translation]. Covariances and information matrices of this
// folder are of such steps, in the order of PoseLink::information.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "libmap/core/pose.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// cross_matrix(a) * b = a x b.
inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return matrix;
}

inline Eigen::Quaterniond rotation_of(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double half = 0.5 * angle;
  const double scale = angle > 1e-8 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  Eigen::Quaterniond rotation(std::cos(half), scale * rotation_vector.x(),
                              scale * rotation_vector.y(), scale * rotation_vector.z());
  return rotation.normalized();
}

inline Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond q(rotation);
  if (q.w() < 0.0) q.coeffs() *= -1.0;
  const double sine = q.vec().norm();
  if (sine < 1e-9) return 2.0 * q.vec();
  return (2.0 * std::atan2(sine, q.w()) / sine) * q.vec();
}

inline Pose moved(const Pose& pose, const Vector6d& step) {
  Pose result = pose;
  result.translation() += pose.linear() * step.head<3>();
  result.linear() = (Eigen::Quaterniond(pose.linear()) * rotation_of(step.tail<3>()))
                        .normalized()
                        .toRotationMatrix();
  return result;
}

// The step that carries `from` to `to`.
inline Vector6d step_between(const Pose& from, const Pose& to) {
  Vector6d step;
  step.head<3>() = from.linear().transpose() * (to.translation() - from.translation());
  step.tail<3>() = rotation_vector_of(from.linear().transpose() * to.linear());
  return step;
}

// Whether two poses differ by no more than this.
inline bool is_near(const Pose& a, const Pose& b, double distance_m, double angle_rad) {
  const Vector6d apart = step_between(a, b);
  return apart.head<3>().norm() <= distance_m && apart.tail<3>().norm() <= angle_rad;
}

// How the step of a_from_b = a^-1 b follows from steps of a and b, to first order.
struct RelativeJacobian {
  Matrix6d by_a;
  Matrix6d by_b;
};
inline RelativeJacobian relative_jacobian(const Pose& a_from_b) {
  RelativeJacobian jacobian{Matrix6d::Zero(), Matrix6d::Identity()};
  const Eigen::Matrix3d b_from_a = a_from_b.linear().transpose();
  jacobian.by_a.topLeftCorner<3, 3>() = -b_from_a;
  jacobian.by_a.topRightCorner<3, 3>() = b_from_a * cross_matrix(a_from_b.translation());
  jacobian.by_a.bottomRightCorner<3, 3>() = -b_from_a;
  return jacobian;
}

}  // namespace libmap
