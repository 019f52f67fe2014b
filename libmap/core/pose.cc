#include "libmap/core/pose.h"

#include <Eigen/SVD>
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

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace libmap
