// Moves a gripper onto the ground and closes its fingers: computes resting pose and contacts.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "libgtd/grasp/finger_closing.h"
#include "libgtd/grasp/ground.h"

namespace libgtd {

// Pose of the palm relative to the frame of the location (GroundPatch) before the approach along
// the palm's axis.
struct ApproachPose {
  double yaw_rad = 0.0;                // about the palm's axis
  Eigen::Vector2d offset_m{0.0, 0.0};  // along x and y
  Eigen::Vector2d tilt_rad{0.0, 0.0};  // about x and y
};

struct ClosedFinger {
  FingerClosing closing;
  double azimuth_rad = 0.0;  // in the gripper frame
  // Share of the finger's sector (from the palm's axis to the open tip) without reliable ground
  // below: holes and border of the scan, and ground with large errors.
  double unseen = 0.0;
};

// Contact of a finger with the ground, in the frame of the ground patch. The normal points out of
// the ground, `outward` away from the palm's axis. `drag` is the direction along the ground, in the
// plane of the finger, in which drive and load pull a spine: toward the axis on level ground,
// upward on ground that falls outward. Unit vectors; `point` in m.
struct GripContact {
  std::size_t finger = 0;
  bool by_spines = false;
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  Eigen::Vector3d drag;
  Eigen::Vector3d outward;
};

// End of the approach. on_ground: the palm or an open finger rests on the ground. no_ground: there
// is no ground below. blocked: the approach starts inside the ground, e.g. below the top of a rock.
enum class ApproachOutcome { on_ground, no_ground, blocked };

struct ClosedGripper {
  ApproachOutcome approach = ApproachOutcome::no_ground;  // `fingers` is empty unless on_ground
  bool palm_touches = false;                              // else an open finger rests on the ground
  Eigen::Isometry3d patch_from_gripper = Eigen::Isometry3d::Identity();  // palm at z = 0, axis z
  std::vector<ClosedFinger> fingers;
  std::vector<GripContact> contacts;  // ascending by finger; link before spines
  double unseen = 0.0;                // mean over the fingers; 1 if there is no ground
};

struct ClosingOptions {
  double start_height_m = 0.15;    // height of the approach's start above the location
  double normal_radius_m = 0.002;  // the normal of a contact is a mean within this radius
  double max_unseen = 0.1;         // a finger with a larger ClosedFinger::unseen has no contacts
};
void bind(libmap::ParameterTable& table, ClosingOptions& options);

// Returns the ground that the gripper may touch at a location (mesh frame, m) from poses with
// offsets and tilts up to `offset_m` and `tilt_rad`; `away` is the direction out of the ground.
// Throws Error if the gripper has no `fingers`.
GroundPatch patch_around(const Ground& ground, const Eigen::Vector3d& location,
                         const Eigen::Vector3d& away, const Gripper& gripper, double offset_m,
                         double tilt_rad, const ClosingOptions& options);

// Moves the gripper down from `pose` and closes it. Throws Error if the gripper has no `fingers`.
ClosedGripper close_gripper(const GroundPatch& patch, const Gripper& gripper,
                            const ApproachPose& pose, const ClosingOptions& options);

}  // namespace libgtd
