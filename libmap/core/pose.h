// Rigid transforms. A variable `a_from_b` maps points from frame b to frame a:
// point_in_a = a_from_b * point_in_b. Frames follow REP-103.
#pragma once

#include <Eigen/Geometry>
#include <string>

namespace libmap {

using Pose = Eigen::Isometry3d;

// Returns the pose of a translation in meters and a quaternion of any non-zero length.
Pose make_pose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation);

// Returns the pose of a translation in meters and roll, pitch, yaw in degrees about the fixed x, y,
// z axes: R = Rz(yaw) Ry(pitch) Rx(roll) (REP-103).
Pose make_pose_from_rpy(const Eigen::Vector3d& translation,
                        const Eigen::Vector3d& roll_pitch_yaw_deg);

// Returns the angles of make_pose_from_rpy in degrees, with pitch from -90 to 90. At a pitch of
// +-90, yaw and roll have the same axis and yaw is arbitrary.
Eigen::Vector3d roll_pitch_yaw_deg(const Pose& pose);

// Returns the least-squares transform target_from_source of >= 3 corresponding points, in columns
// (Umeyama 1991): a homogeneous matrix of rotation, translation and, with `with_scale`, scale.
Eigen::Matrix4d align_points(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target,
                             bool with_scale);

// Returns the smallest rotation from direction `from` to `to`, both not zero. For opposite
// directions, it is a half turn about an arbitrary perpendicular axis.
Eigen::Matrix3d shortest_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Returns the rotation nearest to `matrix` in the least-squares sense (Kabsch 1976).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace libmap
