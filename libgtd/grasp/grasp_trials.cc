#include "libgtd/grasp/grasp_trials.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <tuple>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

// Random key of a location, independent of its position in a list.
std::uint64_t key_of(const Eigen::Vector3d& location) {
  std::uint64_t key = 0;
  for (const double coordinate : location)
    key = libmap::mix_bits(key, std::bit_cast<std::uint64_t>(coordinate + 0.0));
  return key;
}

Eigen::Vector3d away_from(const Ground& ground, const Gripper& gripper,
                          const Eigen::Vector3d& location, ApproachDirection approach) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  if (approach == ApproachDirection::up) return up;
  // Starts with the radius of the palm and doubles it until there is ground.
  for (double radius = 0.0005 * gripper.palm_diameter_mm; radius < 1.0; radius *= 2.0) {
    const auto normal =
        ground.patch(location, up, radius, radius).normal_at(Eigen::Vector3d::Zero(), radius);
    if (normal) return *normal;
  }
  return up;
}

ApproachPose draw_pose(std::uint64_t key, const Gripper& gripper, const GraspOptions& options,
                       std::size_t number) {
  libmap::RandomStream random(options.seed, libmap::mix_bits(key, number));
  const auto normal = [&] { return std::clamp(random.normal(), -4.0, 4.0); };
  ApproachPose pose;
  pose.yaw_rad = random.uniform(0.0, 2.0 * std::numbers::pi / gripper.fingers->count);
  for (double& offset : pose.offset_m) offset = options.offset_m * normal();
  for (double& tilt : pose.tilt_rad)
    tilt = options.tilt_deg * libmap::radians_per_degree * normal();
  return pose;
}

// Parameter sets of the trials, each with its gripper.
struct TrialParameters {
  std::vector<ParameterSet> sets;
  std::vector<Gripper> grippers;

  TrialParameters(const Gripper& gripper, const GraspOptions& options)
      : sets(options.ensemble ? parameter_sets(gripper)
                              : std::vector<ParameterSet>{{1.0, parameters_of(gripper)}}) {
    for (const ParameterSet& set : sets) grippers.push_back(with_parameters(gripper, set.values));
  }

  // Set of a trial, independent of the other trials: two steps of Roberts' two-dimensional
  // sequence, in proportion to the weights.
  std::size_t set_of(std::uint64_t key, int pose, int draw) const {
    const double at =
        libmap::unit_noise(key, 5) + 0.7548776662466927 * pose + 0.5698402909980532 * draw;
    return parameter_set_at(sets, at - std::floor(at));
  }
};

// Data shared by all trials of a location: poses, and the ground that they may touch.
class Site {
 public:
  Site(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
       const GraspOptions& options)
      : ground_(ground),
        gripper_(gripper),
        location_(location),
        options_(options),
        key_(key_of(location)),
        away_(away_from(ground, gripper, location, options.approach)) {}

  std::uint64_t key() const { return key_; }
  const GroundPatch& patch() const { return patch_; }

  void draw_poses(std::size_t count) {
    const bool is_first = poses_.empty();
    const double offset_m = offset_m_;
    const double tilt_rad = tilt_rad_;
    while (poses_.size() < count) {
      const ApproachPose pose = draw_pose(key_, gripper_, options_, poses_.size());
      offset_m_ = std::max(offset_m_, pose.offset_m.norm());
      tilt_rad_ = std::max(tilt_rad_, pose.tilt_rad.norm());
      poses_.push_back(pose);
    }
    if (is_first || offset_m_ > offset_m || tilt_rad_ > tilt_rad)
      patch_ =
          patch_around(ground_, location_, away_, gripper_,
                       offset_m_ + 4.0 * ground_.largest_error_m(), tilt_rad_, options_.closing);
  }

  // Closes the gripper at a drawn pose.
  ClosedGripper close(std::size_t pose) const {
    if (patch_.vertex_errors_m.empty())
      return close_gripper(patch_, gripper_, poses_[pose], options_.closing);
    constexpr std::uint64_t of_surface = 0x73757266616365;
    const std::uint64_t key = libmap::mix_bits(libmap::mix_bits(key_, of_surface), pose);
    return close_gripper(
        displace_vertices(patch_, options_.surface.correlation_m, options_.seed, key), gripper_,
        poses_[pose], options_.closing);
  }

 private:
  const Ground& ground_;
  const Gripper& gripper_;
  const Eigen::Vector3d location_;
  const GraspOptions& options_;
  const std::uint64_t key_;
  const Eigen::Vector3d away_;
  std::vector<ApproachPose> poses_;
  double offset_m_ = 0.0;  // maximum over the poses
  double tilt_rad_ = 0.0;
  GroundPatch patch_;
};

HoldingOptions holding_of(const ClosedGripper& closed, const Gripper& gripper,
                          SpineSharing sharing) {
  HoldingOptions holding;
  holding.load_point = closed.patch_from_gripper.translation();
  holding.holds_when_closed = gripper.fingers->holds_when_closed;
  holding.closing_force_n = gripper.fingers->closing_force_n;
  holding.axis = closed.patch_from_gripper.linear().col(2);
  holding.sharing = sharing;
  return holding;
}

std::vector<BearingContact> draw_asperities(const ClosedGripper& closed, std::uint64_t key,
                                            const Gripper& gripper, const GraspOptions& options,
                                            int pose, int draw) {
  const std::uint64_t number =
      (static_cast<std::uint64_t>(pose) << 32U) | (static_cast<std::uint64_t>(draw) + 1);
  libmap::RandomStream random(options.seed, libmap::mix_bits(~key, number));
  return draw_bearing(closed.contacts, gripper, options.engagement, random);
}

TrialOutcome outcome_of(const ClosedGripper& closed, std::size_t bearing, double force_n,
                        const GraspOptions& options) {
  if (closed.approach != ApproachOutcome::on_ground) return TrialOutcome::approach;
  if (force_n >= options.load_n * options.safety) return TrialOutcome::holds;
  for (const ClosedFinger& finger : closed.fingers)
    if (finger.unseen > options.closing.max_unseen) return TrialOutcome::unseen;
  if (bearing < 2) return TrialOutcome::contact;
  return force_n > 0.0 ? TrialOutcome::load : TrialOutcome::engagement;
}

// Quantile of sorted values, rounded down to a value; 0 without values.
double sorted_quantile(const std::vector<double>& sorted, double fraction) {
  if (sorted.empty()) return 0.0;
  return sorted[static_cast<std::size_t>(fraction * static_cast<double>(sorted.size() - 1))];
}

std::array<double, 3> quantiles(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {sorted_quantile(values, 0.1), sorted_quantile(values, 0.5), sorted_quantile(values, 0.9)};
}

// Adds a pose to the means.
void count_pose(const ClosedGripper& closed, double weight, LocationResult& result) {
  std::vector<bool> touches(closed.fingers.size(), false);
  std::vector<bool> by_spines(closed.fingers.size(), false);
  for (const GripContact& contact : closed.contacts) {
    touches[contact.finger] = true;
    if (contact.by_spines) by_spines[contact.finger] = true;
  }
  for (std::size_t n = 0; n < closed.fingers.size(); ++n)
    (by_spines[n] ? result.spine_fingers
     : touches[n] ? result.link_fingers
                  : result.free_fingers) += weight;
  result.palm_fraction += closed.palm_touches ? weight : 0.0;
  result.unseen += weight * closed.unseen;
  result.clearance_m += weight * closed.patch_from_gripper.translation().z();
}

// Closed gripper of one pose and its trials.
struct PoseTrials {
  ClosedGripper closed;
  std::size_t guess = 0;  // weakest direction of the next draw
  std::vector<double> forces;
};

// All trials of one location, in rounds.
class LocationTrials {
 public:
  LocationTrials(const Ground& ground, const Gripper& gripper, const TrialParameters& parameters,
                 const Eigen::Vector3d& location, const GraspOptions& options)
      : site_(ground, gripper, location, options), parameters_(parameters), options_(options) {
    result_.location = location;
  }

  // Continues to the numbers of poses and draws of a round.
  void go_on(const SequentialRound& round) {
    const auto poses = static_cast<std::size_t>(round.poses);
    site_.draw_poses(poses);
    while (poses_.size() < poses) poses_.push_back({site_.close(poses_.size()), 0, {}});
    for (int pose = 0; pose < round.poses; ++pose) draw(pose, round.draws);
  }

  bool is_clear() const {
    const auto poses = static_cast<double>(poses_.size());
    double trials = 0.0;
    double variance = 0.0;  // of the sum of the final shares of the poses
    for (const PoseTrials& pose : poses_) {
      trials += static_cast<double>(pose.forces.size());
      variance += variance_to_come(pose);
    }
    const double fraction = static_cast<double>(result_.outcomes[0]) / trials;
    constexpr double quantile_of_90_percent = 1.645;
    const auto [low, high] = wilson_interval(fraction, poses, quantile_of_90_percent);
    if (low > 0.5 || high < 0.5) return true;
    return poses_.size() == static_cast<std::size_t>(options_.poses) &&
           std::abs(fraction - 0.5) > quantile_of_90_percent * std::sqrt(variance) / poses;
  }

  LocationResult result() &&;

 private:
  // Variance of the final share of holding draws of a pose. k of n hold so far; with Jeffreys'
  // prior for the probability of the others it is beta distributed.
  double variance_to_come(const PoseTrials& pose) const {
    const auto made = static_cast<double>(pose.forces.size());
    const double to_come = options_.draws - made;
    if (to_come <= 0.0) return 0.0;
    const double holding = static_cast<double>(std::count_if(
        pose.forces.begin(), pose.forces.end(), [&](double force) { return is_held(force); }));
    const double a = holding + 0.5;
    const double b = made - holding + 0.5;
    const double mean = a / (a + b);
    const double variance = mean * (1.0 - mean) / (a + b + 1.0);
    const double of_draws = (mean * (1.0 - mean) - variance) / to_come;
    const double part = to_come / options_.draws;
    return part * part * (variance + of_draws);
  }
  bool is_held(double force_n) const { return force_n >= options_.load_n * options_.safety; }

  void draw(int number, int draws) {
    PoseTrials& pose = poses_[static_cast<std::size_t>(number)];
    for (int n = static_cast<int>(pose.forces.size()); n < draws; ++n) {
      const std::size_t set = parameters_.set_of(site_.key(), number, n);
      const Gripper& gripper = parameters_.grippers[set];
      const HoldingOptions equally = holding_of(pose.closed, gripper, SpineSharing::equally);
      const auto bearing = draw_asperities(pose.closed, site_.key(), gripper, options_, number, n);
      const WeakestDirection least = min_holding_force(bearing, equally, pose.guess);
      pose.guess = least.direction;
      pose.forces.push_back(least.force_n);
      if (n < options_.best_draws)
        best_forces_.push_back(
            min_holding_force(bearing, holding_of(pose.closed, gripper, SpineSharing::best),
                              pose.guess)
                .force_n);
      if (least.force_n > 0.0) log_forces_[set].push_back(std::log(least.force_n));
      if (options_.pull_limits) add_pulls(bearing, equally);
      if (least.force_n > 0.0) ++limiting_[least.direction];
      ++result_.outcomes[static_cast<std::size_t>(
          outcome_of(pose.closed, bearing.size(), least.force_n, options_))];
    }
  }

  void add_pulls(const std::vector<BearingContact>& bearing, const HoldingOptions& holding) {
    for (std::size_t n = 0; n < pulls_.size(); ++n)
      pulls_[n].push_back(holding_force(bearing, pull_directions()[n].vector, holding));
  }

  Site site_;
  const TrialParameters& parameters_;
  const GraspOptions& options_;
  LocationResult result_;
  std::vector<PoseTrials> poses_;
  std::vector<double> best_forces_;
  std::vector<std::vector<double>> log_forces_{parameters_.sets.size()};  // per set, forces > 0
  std::vector<std::size_t> limiting_ = std::vector<std::size_t>(pull_directions().size(), 0);
  std::vector<std::vector<double>> pulls_{pull_directions().size()};  // per direction, all trials
};

// One-way analysis of variance, groups of different sizes.
void find_spreads(const std::vector<std::vector<double>>& groups, LocationResult& result) {
  double count = 0.0;
  double sum = 0.0;
  double within = 0.0;
  double squares = 0.0;  // of the group sizes
  double groups_used = 0.0;
  double between = 0.0;
  for (const std::vector<double>& group : groups) {
    if (group.empty()) continue;
    const auto size = static_cast<double>(group.size());
    const double mean = std::accumulate(group.begin(), group.end(), 0.0) / size;
    for (const double value : group) within += (value - mean) * (value - mean);
    // Updates the mean by this group (Chan et al. 1979).
    if (count > 0.0)
      between += (mean - sum / count) * (mean - sum / count) * count * size / (count + size);
    count += size;
    sum += size * mean;
    squares += size * size;
    groups_used += 1.0;
  }
  const double within_mean = count > groups_used ? within / (count - groups_used) : 0.0;
  result.trial_spread = std::sqrt(within_mean);
  if (groups_used < 2.0) return;
  const double size = (count - squares / count) / (groups_used - 1.0);
  result.parameter_spread =
      std::sqrt(std::max(0.0, between / (groups_used - 1.0) - within_mean) / size);
}

LocationResult LocationTrials::result() && {
  LocationResult& result = result_;
  const GraspOptions& options = options_;
  std::vector<double> forces;
  for (const PoseTrials& pose : poses_) {
    count_pose(pose.closed, 1.0 / static_cast<double>(poses_.size()), result);
    forces.insert(forces.end(), pose.forces.begin(), pose.forces.end());
  }
  result.trials = forces.size();
  result.hold_probability =
      static_cast<double>(result.outcomes[0]) / static_cast<double>(result.trials);
  std::tie(result.hold_low, result.hold_high) =
      wilson_interval(result.hold_probability, static_cast<double>(poses_.size()));
  for (const double load : options.extra_loads_n)
    result.extra_load_probabilities.push_back(
        static_cast<double>(
            std::count_if(forces.begin(), forces.end(),
                          [&](double force) { return force >= load * options.safety; })) /
        static_cast<double>(result.trials));
  result.force_n = quantiles(forces);
  std::vector<double> sorted = forces;
  std::sort(sorted.begin(), sorted.end());
  result.force_range_n = {sorted_quantile(sorted, 0.05), sorted_quantile(sorted, 0.95)};
  result.best_force_n = quantiles(best_forces_);
  find_spreads(log_forces_, result);
  result.limiting_direction = static_cast<std::size_t>(
      std::max_element(limiting_.begin(), limiting_.end()) - limiting_.begin());
  result.has_force = limiting_[result.limiting_direction] > 0;
  if (options.pull_limits)
    for (const std::vector<double>& pulls : pulls_)
      result.pull_limits_n.push_back(quantiles(pulls)[0]);
  const auto nearest = std::min_element(forces.begin(), forces.end(), [&](double a, double b) {
    return std::abs(a - result.force_n[1]) < std::abs(b - result.force_n[1]);
  });
  const auto shown = static_cast<int>(nearest - forces.begin());
  const auto draws = static_cast<int>(poses_.front().forces.size());
  result.median_pose = shown / draws;
  result.median_draw = shown % draws;
  return std::move(result_);
}

LocationResult test_location(const Ground& ground, const Gripper& gripper,
                             const TrialParameters& parameters, const Eigen::Vector3d& location,
                             const GraspOptions& options) {
  LocationTrials trials(ground, gripper, parameters, location, options);
  for (const SequentialRound& round : sequential_rounds(options)) {
    trials.go_on(round);
    if (options.sequential && trials.is_clear()) break;
  }
  return std::move(trials).result();
}

void require_ground(const Ground& ground, const std::vector<Eigen::Vector3d>& locations,
                    double max_distance_m) {
  for (std::size_t n = 0; n < locations.size(); ++n)
    if (!ground.distance(locations[n], max_distance_m))
      throw libmap::Error(
          "not on the mesh",
          {.field = "location " + std::to_string(n + 1),
           .value = libmap::to_text(locations[n].x()) + "," + libmap::to_text(locations[n].y()) +
                    "," + libmap::to_text(locations[n].z()),
           .bound = "within " + libmap::to_text(max_distance_m) + " m of the mesh"});
}

}  // namespace

std::pair<double, double> wilson_interval(double fraction, double count, double z) {
  const double middle = fraction + z * z / (2.0 * count);
  const double half =
      z * std::sqrt(fraction * (1.0 - fraction) / count + z * z / (4.0 * count * count));
  const double scale = 1.0 + z * z / count;
  return {std::clamp((middle - half) / scale, 0.0, fraction),
          std::clamp((middle + half) / scale, fraction, 1.0)};
}

std::vector<SequentialRound> sequential_rounds(const GraspOptions& options) {
  std::vector<SequentialRound> rounds;
  constexpr int first_poses = 4;
  const int few_draws = (options.draws + 3) / 4;
  if (options.sequential) {
    for (int poses = first_poses; poses < options.poses; poses *= 2)
      rounds.push_back({poses, few_draws});
    for (int draws = few_draws; draws < options.draws; draws *= 2)
      rounds.push_back({options.poses, draws});
  }
  rounds.push_back({options.poses, options.draws});
  return rounds;
}

std::vector<LocationResult> test_grasps(const Ground& ground, const Gripper& gripper,
                                        const std::vector<Eigen::Vector3d>& locations,
                                        const GraspOptions& options, libmap::Progress& progress) {
  options.check();
  gripper.check();
  finger_geometry(gripper);  // throws without fingers
  require_ground(ground, locations, options.max_distance_m);
  const TrialParameters parameters(gripper, options);
  std::vector<LocationResult> results(locations.size());
  progress.begin("grasp", locations.size());
  libmap::parallel_for(locations.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      results[n] = test_location(ground, gripper, parameters, locations[n], options);
      progress.advance(1);
    }
  });
  progress.end();
  return results;
}

ClosedPoses::ClosedPoses(const Ground& ground, const Gripper& gripper,
                         const Eigen::Vector3d& location, const GraspOptions& options)
    : options_(options), key_(key_of(location)) {
  Site site(ground, gripper, location, options);
  const auto count = static_cast<std::size_t>(options.poses);
  site.draw_poses(count);
  for (std::size_t pose = 0; pose < count; ++pose) poses_.push_back(site.close(pose));
}

bool ClosedPoses::touch_ground() const {
  return std::any_of(poses_.begin(), poses_.end(),
                     [](const ClosedGripper& closed) { return closed.contacts.size() >= 2; });
}

std::vector<double> ClosedPoses::pull_forces(const Gripper& gripper,
                                             const Eigen::Vector3d& direction, int draws) const {
  std::vector<double> forces;
  for (std::size_t pose = 0; pose < poses_.size(); ++pose) {
    const HoldingOptions holding = holding_of(poses_[pose], gripper, SpineSharing::equally);
    for (int draw = 0; draw < draws; ++draw)
      forces.push_back(holding_force(
          draw_asperities(poses_[pose], key_, gripper, options_, static_cast<int>(pose), draw),
          direction, holding));
  }
  return forces;
}

Trial repeat_trial(const Ground& ground, const Gripper& gripper, const Eigen::Vector3d& location,
                   const GraspOptions& options, int pose, int draw) {
  Site site(ground, gripper, location, options);
  site.draw_poses(static_cast<std::size_t>(pose) + 1);
  Trial trial;
  trial.mesh_from_patch = site.patch().mesh_from_patch;
  trial.gripper = site.close(static_cast<std::size_t>(pose));
  const TrialParameters parameters(gripper, options);
  const Gripper& drawn = parameters.grippers[parameters.set_of(site.key(), pose, draw)];
  trial.bearing = draw_asperities(trial.gripper, site.key(), drawn, options, pose, draw);
  const WeakestDirection least =
      min_holding_force(trial.bearing, holding_of(trial.gripper, drawn, SpineSharing::equally));
  trial.force_n = least.force_n;
  trial.direction = least.direction;
  trial.outcome = outcome_of(trial.gripper, trial.bearing.size(), least.force_n, options);
  return trial;
}

}  // namespace libgtd
