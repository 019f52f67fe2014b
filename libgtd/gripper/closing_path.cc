#include "libgtd/gripper/closing_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "libmap/core/angle.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"

namespace libgtd {

namespace {

// Number of draws: a shifted lattice of powers of `generator` modulo a prime (Korobov 1959). The
// mean pull on level ground is 1 % off in the root mean square of 16 parameter sets, that of 100
// independent draws 5 %.
constexpr std::uint64_t draws = 199;
constexpr std::uint64_t generator = 184;
constexpr std::size_t step_deg = 5;  // of computed pulls; others are interpolated linearly
constexpr double max_spread = 4.0;   // of pulls that are nearly always 0

// A slope of the ground or of a facet.
struct Slope {
  double angle = 0.0;  // rad
  double sine = 0.0;
  double cosine = 1.0;

  explicit Slope(double angle_rad)
      : angle(angle_rad), sine(std::sin(angle_rad)), cosine(std::cos(angle_rad)) {}
};

// Draws the facets that the spines of one finger meet: psi + atan(friction) - 90 degrees,
// descending.
std::vector<Slope> draw_facets(const Gripper& gripper, double fraction, std::uint64_t draw) {
  constexpr std::uint64_t seed = 0x66696e676572;
  libmap::RandomStream shifts(seed, 0);
  std::uint64_t power = draw;
  const auto next = [&] {
    const double value = static_cast<double>(power) / draws + shifts.uniform();
    power = power * generator % draws;
    return value < 1.0 ? value : value - 1.0;
  };
  std::vector<double> facet_angles;
  for (int spine = 0; spine < gripper.fingers->spines_per_finger; ++spine) {
    const bool engages = next() < fraction;
    const double facet_angle = next();
    const Engagement& engagement = gripper.engagement;
    if (engages)
      facet_angles.push_back(
          (engagement.asperity_min_deg +
           facet_angle * (engagement.asperity_max_deg - engagement.asperity_min_deg)) *
          libmap::radians_per_degree);
  }
  std::sort(facet_angles.begin(), facet_angles.end(), std::greater<>());
  const double shift = std::atan(gripper.engagement.friction) - std::numbers::pi / 2.0;
  std::vector<Slope> facets;
  for (const double facet_angle : facet_angles) facets.emplace_back(facet_angle + shift);
  return facets;
}

// Pull in units of the closing force, as is `limit`, the force limit of a spine. `steepness`: psi +
// atan(friction) - 90 degrees of each facet, descending.
double pull_of(const std::vector<Slope>& steepness, const Slope& fall, double limit,
               bool drive_holds) {
  constexpr double right_angle = std::numbers::pi / 2.0;
  const double reaction =
      drive_holds ? std::max(0.0, fall.sine * fall.cosine) / (1.0 + fall.sine * fall.sine) : 0.0;
  double most = 0.0;
  double count = 0.0;
  for (const Slope& facet : steepness) {
    const double angle = fall.angle + facet.angle;
    if (angle <= 0.0) break;
    count += 1.0;
    double pull = count * limit;
    if (angle < right_angle) {
      const double sine = fall.sine * facet.cosine + fall.cosine * facet.sine;
      const double cosine = fall.cosine * facet.cosine - fall.sine * facet.sine;
      pull *= sine;
      // tan / (1 - reaction tan), without a bound where the reaction alone holds
      if (const double rest = cosine - reaction * sine; rest > 0.0)
        pull = std::min(pull, sine / rest);
    }
    most = std::max(most, pull);
  }
  return most;
}

constexpr std::size_t falls = 181;  // -90 .. 90 degrees
constexpr std::size_t level = 90;

struct Pulls {
  std::array<double, falls> means{};
  double level_spread = 0.0;  // standard deviation between draws over the mean, on level ground
};

// Mean pulls at falls of -90 .. 90 degrees.
Pulls pulls_of(const Gripper& gripper) {
  const GripperFingers& fingers = *gripper.fingers;
  const double fraction = engagement_fraction(gripper.engagement, fingers.spine_tip_radius_um);
  std::vector<Slope> slopes;
  for (std::size_t n = 0; n < falls; n += step_deg)
    slopes.emplace_back((static_cast<double>(n) - 90.0) * libmap::radians_per_degree);
  Pulls pulls;
  std::array<double, falls>& means = pulls.means;
  double squares = 0.0;
  for (std::uint64_t draw = 0; draw < draws; ++draw) {
    const std::vector<Slope> facets = draw_facets(gripper, fraction, draw);
    for (std::size_t n = 0; n < falls; n += step_deg) {
      const double pull =
          pull_of(facets, slopes[n / step_deg],
                  fingers.spine_force_limit_n / fingers.closing_force_n, fingers.holds_when_closed);
      means[n] += pull / draws;
      if (n == level) squares += pull * pull / draws;
    }
  }
  const double mean = means[level];
  pulls.level_spread =
      mean > 0.0 ? std::min(max_spread, std::sqrt(std::max(0.0, squares - mean * mean)) / mean)
                 : max_spread;
  for (std::size_t n = 0; n + step_deg < falls; n += step_deg)
    for (std::size_t step = 1; step < step_deg; ++step)
      means[n + step] =
          means[n] + (means[n + step_deg] - means[n]) * static_cast<double>(step) / step_deg;
  return pulls;
}

}  // namespace

FingerPulls finger_pulls(const Gripper& gripper, const std::vector<ParameterSet>& sets) {
  FingerPulls result;
  result.sets = sets.size();
  result.pulls.resize(falls * sets.size());
  result.level_spreads.resize(sets.size());
  result.max_spine_forces.resize(sets.size());
  result.total_closing_forces_n.resize(sets.size());
  libmap::parallel_each(sets.size(), [&](std::size_t s) {
    const Gripper varied = with_parameters(gripper, sets[s].values);
    const Pulls pulls = pulls_of(varied);
    for (std::size_t n = 0; n < falls; ++n)
      result.pulls[n * sets.size() + s] = static_cast<float>(pulls.means[n]);
    result.level_spreads[s] = static_cast<float>(pulls.level_spread);
    const GripperFingers& fingers = *varied.fingers;
    result.max_spine_forces[s] =
        static_cast<float>(fingers.spines_per_finger *
                           engagement_fraction(varied.engagement, fingers.spine_tip_radius_um) *
                           fingers.spine_force_limit_n / fingers.closing_force_n);
    result.total_closing_forces_n[s] = fingers.count * fingers.closing_force_n;
  });
  return result;
}

double ClosingPath::reach_m() const {
  double reach = palm_radius_m;
  for (const auto* points : {&closing, &open})
    for (const PathPoint& point : *points) reach = std::max(reach, point.radius_m);
  return reach;
}

ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m, double load_n) {
  require_fingers(gripper);
  ClosingPath path;
  path.load_n = load_n;
  path.sets = parameter_sets(gripper);
  path.pulls = finger_pulls(gripper, path.sets);
  path.nominal_pulls = finger_pulls(gripper, {{.weight = 1.0, .values = parameters_of(gripper)}});
  path.palm_radius_m = 0.0005 * gripper.palm_diameter_mm;
  const double joint = 0.0005 * gripper.finger_joint_diameter_mm;
  const double proximal = 0.001 * gripper.finger_length_mm;
  const double distal = 0.001 * gripper.spine_length_mm;
  const double curl = gripper.fingers->curl_deg * libmap::radians_per_degree;
  path.finger_length_m = proximal + distal;
  const auto point_at = [&](double angle, double along_proximal, double along_distal) {
    return ClosingPath::PathPoint{
        joint + along_proximal * std::sin(angle) + along_distal * std::sin(angle - curl),
        along_proximal * std::cos(angle) + along_distal * std::cos(angle - curl),
        along_distal > 0.0};
  };
  const double opening = gripper.opening_angle_deg * libmap::radians_per_degree;
  const double closing = gripper.closing_angle_deg * libmap::radians_per_degree;
  const int steps =
      std::max(1, static_cast<int>(std::ceil((opening - closing) * path.finger_length_m /
                                             (0.5 * voxel_size_m))));
  for (int n = 0; n <= steps; ++n) {
    const double angle = opening + (closing - opening) * n / steps;
    for (const double fraction : {1.0, 0.5, 0.0})
      path.closing.push_back(point_at(angle, proximal, fraction * distal));
  }
  const int parts =
      std::max(1, static_cast<int>(std::ceil(path.finger_length_m / (0.5 * voxel_size_m))));
  for (int n = 0; n <= parts; ++n) {
    const double along = path.finger_length_m * n / parts;
    path.open.push_back(
        point_at(opening, std::min(along, proximal), std::max(0.0, along - proximal)));
  }
  return path;
}

}  // namespace libgtd
