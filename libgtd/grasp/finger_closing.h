// Closes one finger of a gripper, two links in a plane, on the profile of the ground until the
// finger makes contact. The plane contains the palm's axis and has coordinates (r, z) in meters: r
// away from the axis, z away from the ground, palm at z = 0. Contacts are computed in closed form,
// so that narrow ridges are not missed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Dimensions in meters and radians. The joint is at (joint_radius_m, 0). With the proximal angle t,
// from the palm's axis to the proximal link, and the curl c, from this link inward to the distal
// link, the links point along (sin t, -cos t) and (sin(t - c), -cos(t - c)).
struct FingerGeometry {
  double joint_radius_m = 0.0;  // distance of the joint from the palm's axis
  double proximal_m = 0.0;      // length of the proximal link
  double distal_m = 0.0;        // length of the distal link
  double opening_rad = 0.0;     // proximal angle of the open finger
  double closing_rad = 0.0;     // proximal angle at the end stop
  double curl_rad = 0.0;        // curl without contact
  double curl_limit_rad = 0.0;  // maximum curl

  // Positions (r, z), m; the knuckle connects both links.
  Eigen::Vector2d joint() const { return {joint_radius_m, 0.0}; }
  Eigen::Vector2d knuckle(double proximal_rad) const;
  Eigen::Vector2d tip(double proximal_rad, double curl) const;
};

// Returns the geometry of a finger. Throws Error if the gripper has no `fingers`.
FingerGeometry finger_geometry(const Gripper& gripper);

// Segment of the ground profile, with the triangle from which the segment is cut.
struct GroundSegment {
  Eigen::Vector2d a;
  Eigen::Vector2d b;
  std::uint32_t triangle = 0;
  bool faces_palm = true;  // the triangle's front faces the palm
};

// Result of closing. spines: the outer half of the distal link is in contact, including the tip.
// link: only the inner half or the proximal link is in contact. end_stop: no contact.
enum class FingerOutcome { spines, link, end_stop };

struct FingerClosing {
  FingerOutcome outcome = FingerOutcome::end_stop;
  double proximal_rad = 0.0;  // angle of the proximal link after closing
  double curl_rad = 0.0;      // curl after closing
  // Contact points on the profile; nullopt without contact.
  std::optional<Eigen::Vector2d> spines;
  std::optional<Eigen::Vector2d> link;  // on the proximal link or the inner half of the distal link
};

// Closes a finger that is open and does not touch the profile. The proximal link turns inward, with
// the distal link at the curl without contact (curl_rad), until a link touches the ground. If this
// is the proximal link, the distal link curls further, up to curl_limit_rad.
FingerClosing close_finger(const FingerGeometry& finger, std::span<const GroundSegment> profile);

// Returns the minimum z of the palm (now at z = 0) at which the open finger is above the whole
// profile; nullopt if no part of the profile is below the finger.
std::optional<double> open_finger_height(const FingerGeometry& finger,
                                         std::span<const GroundSegment> profile);

}  // namespace libgtd
