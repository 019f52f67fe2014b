// Small rigid motions and derivatives, for least squares over poses. A step e = (x y z, rotation
// vector), m and rad, moves a pose T in the frame of T: moved(T, e) = T * [exp(rotation) |
// translation]. Covariances and information matrices refer to such steps, ordered as in PoseLink.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "libmap/core/pose.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// Returns the matrix of the cross product: cross_matrix(a) * b = a x b.
inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return matrix;
}

// Exponential and logarithm of SO(3): rotation of an axis * angle, rad, and back (angle 0 to pi).
Eigen::Quaterniond rotation_of(const Eigen::Vector3d& rotation_vector);
Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation);

// Derivative of rotation_vector_of(R * exp(r)) by r at r = 0, with R = exp(rotation_vector): the
// inverse right Jacobian of SO(3). For rotation_vector_of(exp(r) * R), it is the transpose.
Eigen::Matrix3d rotation_vector_derivative(const Eigen::Vector3d& rotation_vector);

Pose moved(const Pose& pose, const Vector6d& step);  // moves a pose by a step in the pose's frame

// Returns the step e with moved(from, e) = to.
Vector6d step_between(const Pose& from, const Pose& to);
// Derivative of step_between(from, to) with respect to a step of `to`.
Matrix6d step_derivative(const Pose& from, const Pose& to);

// True if two poses differ by at most `distance_m` and `angle_rad`.
bool is_near(const Pose& a, const Pose& b, double distance_m, double angle_rad);

// Derivatives of a step of the relative pose a_from_b = a^-1 * b with respect to steps of a and b.
struct RelativeJacobian {
  Matrix6d by_a;  // minus the adjoint of b_from_a
  Matrix6d by_b;  // the identity
};
RelativeJacobian relative_jacobian(const Pose& a_from_b);

}  // namespace libmap
