// Section `urdf` of a gripper file: derives dimensions from the links and joints of a URDF (Unified
// Robot Description Format, http://wiki.ros.org/urdf/XML).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"

namespace libgtd {

// Names of joints and links of the URDF. Each name of a joint or link of the fingers contains a '*'
// for the text that differs between fingers, e.g. "finger_*_joint", or is a comma-separated list of
// the names of all fingers, in the same order for each key.
struct UrdfMapping {
  std::string file;          // path of the URDF, relative to the gripper file
  std::string palm_link;     // link with the origin at the center of the palm's face
  std::string palm_axis;     // direction X,Y,Z toward the ground, in the frame of palm_link
  std::string finger_joint;  // revolute joint from palm to finger; limits: open, closed
  std::string spine_joint;   // joint from finger to spine carrier, revolute or fixed
  std::string tip_link;      // link with the origin at the spine tip
};

// Binds the keys "urdf.KEY" of a gripper file.
void bind(libmap::ParameterTable& table, UrdfMapping& mapping);

// Returns the keys and values of a gripper file that the URDF (the text `xml`) determines:
//   palm_diameter_mm          if the palm has a cylinder as collision or visual geometry
//   finger_joint_diameter_mm, finger_length_mm, spine_length_mm, fingers.count
//   opening_angle_deg, closing_angle_deg, opening_spine_radius_mm, opening_spine_depth_mm,
//   closing_height_mm         at the limits of the finger joint
//   fingers.curl_deg          with the spine joint at rest: 0, or the limit nearest to 0
//   fingers.curl_limit_deg    if the spine joint has limits
// Runs urdfdom in a separate process. Throws Error if
// - a joint or link is missing, or links form a cycle,
// - a joint between palm and tip is movable, except finger joint and spine joint,
// - a finger joint is not revolute, or its axis is not tangential to the circle of joints,
// - fingers are not evenly spaced, or differ by more than 0.1 mm or 0.1 degrees, or
// - a length is more than 1 m, or an angle more than 2 pi.
std::vector<std::pair<std::string, std::string>> read_urdf_dimensions(const std::string& xml,
                                                                      const UrdfMapping& mapping);

}  // namespace libgtd
