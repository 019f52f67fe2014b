// A gripper moves onto the ground and closes its fingers: where it comes to rest and what touches.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "libgtd/grasp/finger_closing.h"
#include "libgtd/grasp/ground.h"

namespace libgtd {

// Of the palm against the location's frame (GroundPatch), before it moves along the palm's axis.
struct ApproachPose {
  double yaw_rad = 0.0;
  Eigen::Vector2d offset_m{0.0, 0.0};
  Eigen::Vector2d tilt_rad{0.0, 0.0};  // about x and y
};

struct ClosedFinger {
  FingerClosing closing;
  double azimuth_rad = 0.0;  // in the gripper's frame
  // The share of the finger's strip, from the palm's axis to the open tip and weighted as a sector
  // of the disc, without sure ground below it: a hole of the scan, its border, or a large error.
  double unseen = 0.0;
};

// In the patch's frame. A contact's normal is out of the ground; `outward` is away from the palm's
// axis. The drag is the way along the ground, in the finger's plane, that drive and load pull a
// spine: toward the axis where the ground is level, up where it falls outward. Unit vectors.
struct GripContact {
  std::size_t finger = 0;
  bool by_spines = false;
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  Eigen::Vector3d drag;
  Eigen::Vector3d outward;
};

// on_ground: the palm or an open finger rests on the ground. no_ground: there is none below.
// blocked: the way begins inside the ground, for instance under the top of a higher rock.
enum class ApproachEnd { on_ground, no_ground, blocked };

struct ClosedGripper {
  ApproachEnd approach = ApproachEnd::no_ground;  // unless on_ground, there are no fingers
  bool palm_touches = false;                      // else an open finger is in the palm's way
  Eigen::Isometry3d patch_from_gripper = Eigen::Isometry3d::Identity();  // palm at z = 0, axis z
  std::vector<ClosedFinger> fingers;
  std::vector<GripContact> contacts;  // by finger, its link before its spines
  double unseen = 0.0;                // mean of the fingers; 1 without ground
};

struct ClosingOptions {
  double start_height_m = 0.15;    // the way down begins this far above the location
  double normal_radius_m = 0.002;  // of a contact: mean normal of the ground within it
  double max_unseen = 0.1;         // a finger with more of its strip unseen gets no contact
};
void bind(libmap::ParameterTable& table, ClosingOptions& options);

// The part of the ground that the gripper may touch from poses with offsets up to `offset_m` and
// tilts up to `tilt_rad`.
GroundPatch patch_around(const Ground& ground, const Eigen::Vector3d& location,
                         const Eigen::Vector3d& away, const Gripper& gripper, double offset_m,
                         double tilt_rad, const ClosingOptions& options);

// Throws Error if the gripper has no `fingers`.
ClosedGripper close_gripper(const GroundPatch& patch, const Gripper& gripper,
                            const ApproachPose& pose, const ClosingOptions& options);

}  // namespace libgtd
