// The largest pull that the contacts of a closed gripper balance.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "libgtd/grasp/bearing.h"

namespace libgtd {

struct HoldingOptions {
  // The pull acts here (m), without a moment.
  Eigen::Vector3d load_point{0.0, 0.0, 0.0};
  // A finger's force toward the palm's axis is at most this. If the drives hold what presses them
  // open, a finger is rigid and turns its part of the pull into such a force; see holding_force.
  double closing_force_n = 10.0;
  bool holds_when_closed = true;
  Eigen::Vector3d axis{0.0, 0.0, 1.0};  // of the palm, away from the ground
  SpineSharing sharing = SpineSharing::best;
};

// max F so that forces f_i of the contacts, each in its set, balance the pull F w:
//   sum f_i + F w = 0,  sum (p_i - p) x f_i = 0,  sum over finger k of r_k . f_i <= P + c_k F / m
// (Kumar and Waldron 1988), r_k outward, m fingers with contacts. c_k is 0, or with drives that
// hold sin g cos g / (1 + sin^2 g) of the finger's steepest contact, on ground that falls outward
// by g: what an elastic contact that is twice as stiff along the ground as across it turns of the
// pull into a force toward the axis (Chen et al. 2024). N; 0 if no pull along the unit vector w can
// be balanced. The search may end with a smaller value that is at least `enough`.
double holding_force(const std::vector<BearingContact>& contacts, const Eigen::Vector3d& direction,
                     const HoldingOptions& options,
                     double enough = std::numeric_limits<double>::infinity());

// A direction of the pull: `tilt_deg` from the direction away from the ground and, unless that is
// 0, at this azimuth from the frame's x axis.
struct PullDirection {
  int tilt_deg = 0;
  int azimuth_deg = 0;
  Eigen::Vector3d vector;

  std::string name() const;  // "away", "45@90", "90@315"
};

// The 17 that are tried: away, and 45 and 90 degrees at eight azimuths.
const std::vector<PullDirection>& pull_directions();

// The least holding force of these directions.
struct LeastForce {
  double force_n = 0.0;
  std::size_t direction = 0;  // in pull_directions(); one of equal ones
};

// `first` is tried first: a good guess saves time and changes nothing but the choice among equal
// ones.
LeastForce least_holding_force(const std::vector<BearingContact>& contacts,
                               const HoldingOptions& options, std::size_t first = 0);

}  // namespace libgtd
