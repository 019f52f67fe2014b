// The section `urdf` of a gripper file: measures from the links and joints of a URDF (Unified Robot
// Description Format, http://wiki.ros.org/urdf/XML), so that they need not be stated.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"

namespace libgtd {

// Names of the URDF's joints and links. Those of fingers contain a '*' in place of what differs
// from finger to finger, "finger_*_joint", or are a list with commas, in the same order for each
// key.
struct UrdfMapping {
  std::string file;          // of the URDF, relative to the gripper file
  std::string palm_link;     // its origin is the center of the palm's face
  std::string palm_axis;     // X,Y,Z in its frame, from the palm toward the ground
  std::string finger_joint;  // revolute, palm to finger; its limits are wide open and closed
  std::string spine_joint;   // finger to spine carrier; revolute or fixed
  std::string tip_link;      // its origin is the spine's tip
};

// The keys "urdf.KEY" of a gripper file, bound to `mapping`.
void bind(libmap::ParameterTable& table, UrdfMapping& mapping);

// Keys of a gripper file and their values, for what the URDF states:
//   palm_diameter_mm             if the palm has a cylinder as collision or visual geometry
//   finger_joint_diameter_mm, finger_length_mm, spine_length_mm
//   opening_angle_deg, closing_angle_deg      of the finger joint's limits
//   opening_spine_radius_mm, opening_spine_depth_mm, closing_height_mm   of the tips at these
//   limits fingers.count, fingers.curl_deg           the spine joint at rest: 0, or the limit
//   nearest to it fingers.curl_limit_deg                    if the spine joint has limits
// urdfdom runs in a process of its own. Throws Error naming joint or link: one that is missing,
// moves in between or is part of a circle; a finger joint that is not revolute, or whose axis is
// not tangential to the circle of joints; fingers that differ by more than 0.1 mm or 0.1 degrees,
// or are not evenly spaced; lengths beyond 1 m, angles beyond 2 pi.
std::vector<std::pair<std::string, std::string>> measures_of_urdf(const std::string& xml,
                                                                  const UrdfMapping& mapping);

}  // namespace libgtd
