// Holding force of a closed gripper: the largest pull in a direction that the contacts balance.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "libgtd/grasp/bearing.h"

namespace libgtd {

struct HoldingOptions {
  // Point (m) at which the pull acts, without a moment. All vectors: frame of the ground patch.
  Eigen::Vector3d load_point{0.0, 0.0, 0.0};
  // Maximum force P of the drive of a finger toward the palm's axis. If the drives resist opening
  // (holds_when_closed), fingers are rigid and convert a part of the pull into a force to the axis.
  double closing_force_n = 10.0;
  bool holds_when_closed = true;
  Eigen::Vector3d axis{0.0, 0.0, 1.0};  // axis of the palm, away from the ground
  SpineSharing sharing = SpineSharing::best;
};

// Returns the maximum F (N) for which forces f_i of the contacts (BearingContact) at points p_i
// balance the pull F w along the unit vector w at the load point p; 0 if they balance no pull:
//   sum f_i + F w = 0,  sum (p_i - p) x f_i = 0,  sum over finger k of r_k . f_i <= P + c_k F / m
// (Kumar and Waldron 1988), where r_k is the outward direction of finger k and m the number of
// fingers with contacts. If the drives resist opening, c_k = sin g cos g / (1 + sin^2 g), where the
// ground at the finger's steepest contact falls outward by g: an elastic contact, twice as stiff
// along the ground as across it, converts this part of the pull into a force toward the axis (Chen
// et al. 2024). Else c_k = 0. The search may stop at a smaller value >= `sufficient_force_n`.
double holding_force(const std::vector<BearingContact>& contacts, const Eigen::Vector3d& direction,
                     const HoldingOptions& options,
                     double sufficient_force_n = std::numeric_limits<double>::infinity());

// Direction of a pull: tilted by `tilt_deg` from the z axis of the ground patch (away from the
// ground) to the azimuth `azimuth_deg` from the x axis (0 if the tilt is 0).
struct PullDirection {
  int tilt_deg = 0;
  int azimuth_deg = 0;
  Eigen::Vector3d vector;

  std::string name() const;  // "away", "45@90", "90@315"
};

// Returns the 17 tested directions: tilt 0, and tilts of 45 and 90 degrees at eight azimuths.
const std::vector<PullDirection>& pull_directions();

// Minimum holding force over pull_directions().
struct WeakestDirection {
  double force_n = 0.0;
  std::size_t direction = 0;  // index in pull_directions(); if tied, any
};

// Computes the minimum holding force. Direction `first` is tested first; a good guess saves time
// and only affects the choice of tied directions.
WeakestDirection min_holding_force(const std::vector<BearingContact>& contacts,
                                   const HoldingOptions& options, std::size_t first = 0);

}  // namespace libgtd
