// Rigid transforms. A variable `a_from_b` carries points of frame b into frame a:
// point_in_a = a_from_b * point_in_b. Frames follow REP-103.
#pragma once

#include <Eigen/Geometry>
#include <string>

namespace libmap {

using Pose = Eigen::Isometry3d;

// Translation in meters and a quaternion of any non-zero length.
Pose make_pose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation);

// Roll, pitch, yaw in degrees about the fixed x, y, z axes: R = Rz(yaw) Ry(pitch) Rx(roll)
// (REP-103).
Pose make_pose_from_rpy(const Eigen::Vector3d& translation,
                        const Eigen::Vector3d& roll_pitch_yaw_deg);

// The angles of make_pose_from_rpy: pitch from -90 to 90; where it is one of them yaw and roll turn
// about the same axis, and yaw is as it happens.
Eigen::Vector3d roll_pitch_yaw_deg(const Pose& pose);

// target_from_source as a homogeneous matrix, by least squares over the points of the columns
// (Umeyama 1991): a rotation, a translation and, with `with_scale`, a scale. At least three points.
Eigen::Matrix4d align_points(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target,
                             bool with_scale);

// The rotation that turns `from` onto `to` by the smallest angle; of opposite directions a half
// turn about any axis across them. Neither is zero.
Eigen::Matrix3d shortest_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// The nearest proper rotation in the least-squares sense (Kabsch 1976), for matrices read from
// text.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace libmap
