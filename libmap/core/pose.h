// Rigid transforms. A variable `a_from_b` carries points of frame b into frame a:
// point_in_a = a_from_b * point_in_b. Frames follow REP-103.
#pragma once

#include <Eigen/Geometry>
#include <string>

namespace libmap {

using Pose = Eigen::Isometry3d;

// Translation in metres and a quaternion of any non-zero length.
Pose make_pose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation);

// Roll, pitch, yaw in degrees about the fixed x, y, z axes: R = Rz(yaw) Ry(pitch) Rx(roll)
// (REP-103).
Pose make_pose_from_rpy(const Eigen::Vector3d& translation,
                        const Eigen::Vector3d& roll_pitch_yaw_deg);

// The nearest proper rotation in the least-squares sense (Kabsch 1976), for matrices read from
// text.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace libmap
