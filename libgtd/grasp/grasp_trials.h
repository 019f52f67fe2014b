// The virtual field test: a gripper closed many times on the ground at each location, with yaw,
// offset, tilt and asperities drawn anew, and pulled in 17 directions.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/bearing.h"
#include "libgtd/grasp/gripper_closing.h"
#include "libgtd/grasp/holding_force.h"
#include "libgtd/grasp/surface_error.h"
#include "libmap/core/progress.h"

namespace libgtd {

// up: against gravity (the mesh's z). normal: along the ground's mean normal within the palm's
// radius of the location.
enum class ApproachDirection { up, normal };

struct GraspOptions {
  double load_n = 5.0;  // a trial holds if its force is at least load * safety in all directions
  double safety = 1.0;
  std::vector<double> more_loads_n;  // whose probabilities are computed too
  ApproachDirection approach = ApproachDirection::up;
  int poses = 32;  // of a location
  int draws = 32;  // of asperities at each pose
  // Draws of a pose for which the force with the best sharing (SpineSharing) is computed too.
  int best_draws = 2;
  // Whether LocationResult::pull_limits_n is computed. Not bound to a key.
  bool pull_limits = false;
  // Ends early where the verdict is clear: see sequential_rounds. Not bound to a key.
  bool sequential = false;
  std::uint64_t seed = 1;
  double offset_m = 0.005;       // standard deviation of the palm's place, each of x and y
  double tilt_deg = 3.0;         // standard deviation of its tilt, about each of x and y
  double max_distance_m = 0.05;  // of a location from the ground
  // Trials take turns over parameter_sets(gripper); else all have the gripper file's parameters.
  bool ensemble = true;
  ClosingOptions closing;
  EngagementOptions engagement;
  SurfaceErrorOptions surface;  // of a ground with errors: each pose is on a surface drawn anew

  // Throws Error naming the field, its value and the bound that it breaks.
  void check() const;
};
void bind(libmap::ParameterTable& table, GraspOptions& options);

// Why a trial does not hold. approach: no ground below, or the way begins inside it. contact: less
// than two contacts. engagement: the contacts balance no pull in some direction. load: they do, but
// not the load. unseen: one of these, and a finger had too much unseen ground.
enum class TrialEnd { holds, approach, contact, engagement, load, unseen };
const std::vector<std::pair<std::string, TrialEnd>>& trial_end_names();

struct Trial {
  Eigen::Isometry3d mesh_from_patch = Eigen::Isometry3d::Identity();
  ClosedGripper gripper;
  std::vector<BearingContact> bearing;
  TrialEnd end = TrialEnd::approach;
  double force_n = 0.0;       // equal sharing, the least of the directions
  std::size_t direction = 0;  // the index of that direction in pull_directions()
};

struct LocationResult {
  Eigen::Vector3d location;  // as given
  std::size_t trials = 0;
  std::array<std::size_t, 6> ends{};  // by TrialEnd
  double hold_probability = 0.0;
  // Wilson's interval of 95 %; trials of one pose depend on each other, so a pose counts once.
  double hold_low = 0.0;
  double hold_high = 0.0;
  std::vector<double> more_probabilities;  // of more_loads_n
  std::array<double, 3> force_n{};         // equal sharing: quantiles 0.1, 0.5, 0.9 of the trials
  std::array<double, 3> best_force_n{};    // the same of the best sharing
  std::size_t limiting_direction = 0;      // most often the weakest; of trials with any force
  bool has_force = false;                  // some trial has one
  std::array<double, 2> force_range_n{};   // quantiles 0.05 and 0.95 of the trials
  // Standard deviations of ln(force) of trials with a force (analysis of variance): between trials
  // of one parameter set, and between the sets.
  double trial_spread = 0.0;
  double parameter_spread = 0.0;
  // Of each of pull_directions(): the pull that nine of ten trials hold (equal sharing), N.
  std::vector<double> pull_limits_n;
  // Means over the poses.
  double spine_fingers = 0.0;
  double link_fingers = 0.0;  // a link touches, no spine does
  double free_fingers = 0.0;
  double palm_share = 0.0;   // of poses in which the palm touches the ground
  double unseen = 0.0;       // share of the fingers' strips, as ClosedFinger
  double clearance_m = 0.0;  // of the palm above the location
  // The trial whose force is nearest to the median.
  int shown_pose = 0;
  int shown_draw = 0;

  bool holds() const { return hold_probability >= 0.5; }
};

// Of a sequential test: 4, 8, 16, ... and all poses with a quarter of the draws each, then all with
// twice as many, ..., at last with all: draws of one pose say little more than a few of them. It
// ends after a round when Wilson's interval of 90 %, poses as the count, excludes 0.5, or when all
// poses are made and the share is farther from 0.5 than 1.645 standard deviations of what the draws
// to come may change (beta distributed, Jeffreys' prior). A test that goes on to the last round has
// the same trials as one that is not sequential.
struct SequentialRound {
  int poses = 0;
  int draws = 0;
};
std::vector<SequentialRound> sequential_rounds(const GraspOptions& options);

// Tests all locations (m, in the mesh's frame). The result of a location depends on its coordinates
// and the seed, not on the other locations, their order or the number of threads. Throws Error: a
// bound of the options is broken, the gripper has no `fingers`, or a location is farther from the
// ground than `max_distance_m` (its number from 1 is the field).
std::vector<LocationResult> test_grasps(const Ground& ground, const Gripper& gripper,
                                        const std::vector<Eigen::Vector3d>& locations,
                                        const GraspOptions& options, libmap::Progress& progress);

// One trial of a location again, for a picture of it.
Trial repeat_trial(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
                   const GraspOptions& options, int pose, int draw);

// A gripper closed at drawn poses of one location (GraspOptions::poses), to be pulled with any
// parameters.
class ClosedPoses {
 public:
  // Throws nothing of the location: see touch_ground().
  ClosedPoses(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
              const GraspOptions& options);

  // Whether some pose has two contacts.
  bool touch_ground() const;
  // The largest pulls (N) along a unit vector in the location's frame (GroundPatch) that `draws`
  // draws of asperities at each pose hold, with the parameters of this gripper. The same draws for
  // all parameters.
  std::vector<double> pull_forces(const Gripper& gripper, const Eigen::Vector3d& direction,
                                  int draws) const;

 private:
  std::vector<ClosedGripper> poses_;
  GraspOptions options_;
  std::uint64_t key_ = 0;
};

// Wilson's score interval of a share (Wilson 1927): {low, high}; z is a
// quantile of the normal distribution, by default that of 95 %.
std::pair<double, double> wilson_interval(double share, double count, double z = 1.959963984540054);

}  // namespace libgtd
