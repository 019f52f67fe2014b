#include "libmap/core/pose.h"

#include <Eigen/SVD>
#include <cmath>
#include <numbers>

namespace libmap {

Pose make_pose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation) {
  Pose pose = Pose::Identity();
  pose.translation() = translation;
  pose.linear() = rotation.normalized().toRotationMatrix();
  return pose;
}

Pose make_pose_from_rpy(const Eigen::Vector3d& translation,
                        const Eigen::Vector3d& roll_pitch_yaw_deg) {
  const Eigen::Vector3d angles = roll_pitch_yaw_deg * (std::numbers::pi / 180.0);
  Pose pose = Pose::Identity();
  pose.translation() = translation;
  pose.linear() = (Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  return pose;
}

Eigen::Vector3d roll_pitch_yaw_deg(const Pose& pose) {
  const Eigen::Matrix3d r = pose.linear();
  const double yaw = std::atan2(r(1, 0), r(0, 0));
  const double pitch = std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0)));
  // Roll is read from Rz(-yaw) R, whose middle row is (0, cos roll, -sin roll). Near +-90 deg of
  // pitch, yaw is arbitrary, but the three angles still reproduce R.
  const double s = std::sin(yaw);
  const double c = std::cos(yaw);
  const double roll = std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1));
  return Eigen::Vector3d(roll, pitch, yaw) * (180.0 / std::numbers::pi);
}

Eigen::Matrix4d align_points(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target,
                             bool with_scale) {
  return Eigen::umeyama(source, target, with_scale);
}

// Eigen::Quaterniond::FromTwoVectors without its singular value decomposition for opposite
// directions.
Eigen::Matrix3d shortest_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  const double cosine = b.dot(a);
  Eigen::Quaterniond turn;
  if (cosine < -1.0 + Eigen::NumTraits<double>::dummy_precision()) {
    turn.w() = 0.0;
    turn.vec() = a.unitOrthogonal();
  } else {
    const double s = std::sqrt((1.0 + cosine) * 2.0);
    turn.vec() = a.cross(b) * (1.0 / s);
    turn.w() = s * 0.5;
  }
  return turn.toRotationMatrix();
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace libmap
