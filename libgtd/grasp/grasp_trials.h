// Virtual field test: closes a gripper many times on the ground at each location, with random yaw,
// offset, tilt and asperities, and pulls the gripper in 17 directions.
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

// Direction opposite to the approach. up: against gravity (z of the mesh). normal: mean normal of
// the ground near the location, within the palm radius, which is doubled until there is ground.
enum class ApproachDirection { up, normal };

struct GraspOptions {
  double load_n = 5.0;  // a trial holds if the force >= load_n * safety in all directions
  double safety = 1.0;
  std::vector<double> extra_loads_n;  // for LocationResult::extra_load_probabilities
  ApproachDirection approach = ApproachDirection::up;
  int poses = 32;      // poses per location
  int draws = 32;      // draws of asperities per pose
  int best_draws = 2;  // draws per pose that are also evaluated with SpineSharing::best
  // true: computes LocationResult::pull_limits_n. Not a parameter in bind().
  bool pull_limits = false;
  // true: ends a test when holds() is almost certain (SequentialRound). Not a parameter in bind().
  bool sequential = false;
  std::uint64_t seed = 1;
  double offset_m = 0.005;       // standard deviation of the palm position in x and y
  double tilt_deg = 3.0;         // standard deviation of the tilt about x and y
  double max_distance_m = 0.05;  // maximum distance of a location from the ground
  // true: trials cycle through parameter_sets(gripper). false: values of the gripper file.
  bool ensemble = true;
  ClosingOptions closing;
  EngagementOptions engagement;
  SurfaceErrorOptions surface;  // for ground with errors: each pose has a random surface

  // Throws Error naming field, value and bound if an option is out of range.
  void check() const;
};
void bind(libmap::ParameterTable& table, GraspOptions& options);

// Outcome of a trial: holds, or the cause of failure:
// - approach: no ground is below, or the approach starts inside the ground.
// - contact: fewer than two contacts of links or engaged spines.
// - engagement: in some direction, the contacts balance no pull at all.
// - load: in some direction, the contacts balance a smaller pull than the load.
// - unseen: instead of contact, engagement or load if a finger exceeds ClosingOptions::max_unseen.
enum class TrialOutcome { holds, approach, contact, engagement, load, unseen };
const std::vector<std::pair<std::string, TrialOutcome>>& trial_outcome_names();

struct Trial {
  Eigen::Isometry3d mesh_from_patch = Eigen::Isometry3d::Identity();
  ClosedGripper gripper;
  std::vector<BearingContact> bearing;  // contacts that bear forces
  TrialOutcome outcome = TrialOutcome::approach;
  double force_n = 0.0;       // holding force: equal sharing, minimum over directions
  std::size_t direction = 0;  // direction of the minimum, index in pull_directions()
};

struct LocationResult {
  Eigen::Vector3d location;  // as given, in the mesh frame, m
  std::size_t trials = 0;
  std::array<std::size_t, 6> outcomes{};  // number of trials per TrialOutcome
  double hold_probability = 0.0;          // share of trials that hold load_n * safety
  // 95 % Wilson interval. A pose is one sample, because the trials of a pose are correlated.
  double hold_low = 0.0;
  double hold_high = 0.0;
  std::vector<double> extra_load_probabilities;  // hold probabilities of extra_loads_n
  std::array<double, 3> force_n{};       // holding force (equal sharing): quantiles 0.1, 0.5, 0.9
  std::array<double, 3> best_force_n{};  // with SpineSharing::best, over best_draws
  // Most frequent direction of minimum force (trials with a force); index in pull_directions().
  std::size_t limiting_direction = 0;
  bool has_force = false;                 // at least one trial has a force
  std::array<double, 2> force_range_n{};  // holding force (equal sharing): quantiles 0.05, 0.95
  // Standard deviations of ln(force) over trials with a force (analysis of variance): between
  // trials of one parameter set, and between the sets.
  double trial_spread = 0.0;
  double parameter_spread = 0.0;
  // Per direction of pull_directions(): pull that 90 % of the trials hold (equal sharing), N.
  std::vector<double> pull_limits_n;
  // Mean numbers of fingers per pose: with spine contact, with link contact only, without contact.
  double spine_fingers = 0.0;
  double link_fingers = 0.0;
  double free_fingers = 0.0;
  double palm_fraction = 0.0;  // fraction of poses in which the palm touches the ground
  double unseen = 0.0;         // mean of ClosedGripper::unseen over the poses
  double clearance_m = 0.0;    // mean height of the palm above the location
  // Trial with the force nearest to the median, for repeat_trial.
  int median_pose = 0;
  int median_draw = 0;

  bool holds() const { return hold_probability >= 0.5; }
};

// Round of a sequential test of a location: numbers of poses, and of draws per pose, that are
// completed after the round. Rounds first increase the poses (4, 8, 16, ... to all) with a quarter
// of the draws, then double the draws until all are used. The test ends after a round if
// - the 90 % Wilson interval of the holding fraction, with poses as samples, excludes 0.5, or
// - all poses are done, and the fraction differs from 0.5 by more than 1.645 standard deviations of
//   the change that the remaining draws may cause (beta distribution, Jeffreys prior).
struct SequentialRound {
  int poses = 0;
  int draws = 0;
};
// Returns the rounds; without `sequential`, one round of all trials.
std::vector<SequentialRound> sequential_rounds(const GraspOptions& options);

// Tests all locations (m, in the mesh frame), in their order. A result does not depend on the other
// locations or the number of threads. Throws Error for options out of range, a gripper without
// `fingers`, and a location farther from the ground than `max_distance_m` (the field is the number
// of the location, from 1).
std::vector<LocationResult> test_grasps(const Ground& ground, const Gripper& gripper,
                                        const std::vector<Eigen::Vector3d>& locations,
                                        const GraspOptions& options, libmap::Progress& progress);

// Repeats one trial of a location, for display. `pose` and `draw` count from 0.
Trial repeat_trial(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
                   const GraspOptions& options, int pose, int draw);

// Gripper closed in random poses at one location (GraspOptions::poses). Computes pulls for any
// force parameters without closing the gripper again, for fits to pull tests.
class ClosedPoses {
 public:
  // Does not throw if the location has no ground; touch_ground() is then false.
  ClosedPoses(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
              const GraspOptions& options);

  // Returns true if at least one pose has two contacts.
  bool touch_ground() const;
  // Returns the holding forces (N) along a unit vector in the frame of the location (GroundPatch)
  // with the parameters of `gripper`, one for each pose and each of `draws` draws of asperities.
  // All parameters use the same random draws.
  std::vector<double> pull_forces(const Gripper& gripper, const Eigen::Vector3d& direction,
                                  int draws) const;

 private:
  std::vector<ClosedGripper> poses_;
  GraspOptions options_;
  std::uint64_t key_ = 0;
};

// Returns the Wilson score interval {low, high} of a proportion (Wilson 1927). `z` is a quantile of
// the normal distribution; the default gives a 95 % interval.
std::pair<double, double> wilson_interval(double fraction, double count,
                                          double z = 1.959963984540054);

}  // namespace libgtd
