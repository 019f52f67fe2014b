#include "libmap/site/ground_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/geometry/plane_fit.h"
#include "libmap/geometry/robust.h"

namespace libmap {

namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr std::size_t max_drawn = 20000;  // points for RANSAC
constexpr std::size_t first_look = 2000;  // points that evaluate every hypothesis
constexpr std::size_t second_look = 20;   // best hypotheses, evaluated on all points
constexpr int max_rounds = 10;            // maximum number of planes, walls included
constexpr std::uint64_t points_stream = 0, hypotheses_stream = 1;  // random number streams

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();

  double height(const Eigen::Vector3d& point) const { return normal.dot(point - center); }
};

constexpr std::size_t points_per_chunk = 8192;

bool is_plane(const PlaneSpread& spread) { return spread.is_plane(1e-12); }

Plane plane_of(const PlaneSpread& spread, const Eigen::Vector3d& up) {
  Plane plane{spread.axes.col(0), spread.center};
  if (plane.normal.dot(up) < 0.0) plane.normal = -plane.normal;
  return plane;
}

std::size_t count_near(const Points& points, std::size_t count, const Plane& plane,
                       double tolerance) {
  std::size_t near = 0;
  for (std::size_t n = 0; n < count; ++n)
    near += std::abs(plane.height(points[n])) <= tolerance ? 1U : 0U;
  return near;
}

// Random planes through three points each, within max_tilt_deg of up.
std::vector<Plane> draw_hypotheses(const Points& points, const GroundPlaneOptions& options,
                                   const Eigen::Vector3d& up, RandomStream& random) {
  const auto draw = [&] { return random.below(points.size()); };
  std::vector<Plane> planes;
  for (int n = 0; n < options.hypotheses; ++n) {
    const Eigen::Vector3d& a = points[draw()];
    const Eigen::Vector3d ab = points[draw()] - a;
    const Eigen::Vector3d ac = points[draw()] - a;
    Eigen::Vector3d normal = ab.cross(ac);
    if (!(normal.norm() > 1e-6 * ab.norm() * ac.norm())) continue;
    normal.normalize();
    if (normal.dot(up) < 0.0) normal = -normal;
    if (degrees_between(normal, up) <= options.max_tilt_deg) planes.push_back({normal, a});
  }
  return planes;
}

// Finds the hypothesis with the most inliers and fits it to them; nullopt if there is none.
std::optional<Plane> best_plane(const Points& points, const GroundPlaneOptions& options,
                                const Eigen::Vector3d& up, RandomStream& random) {
  const std::vector<Plane> planes = draw_hypotheses(points, options, up, random);
  if (planes.empty()) return std::nullopt;
  const auto counts_on = [&](const std::vector<std::size_t>& which, std::size_t count) {
    std::vector<std::size_t> counts(which.size());
    parallel_each(which.size(), 16, [&](std::size_t n) {
      counts[n] = count_near(points, count, planes[which[n]], options.tolerance_m);
    });
    return counts;
  };
  std::vector<std::size_t> order(planes.size());
  for (std::size_t n = 0; n < order.size(); ++n) order[n] = n;
  const std::vector<std::size_t> first = counts_on(order, std::min(first_look, points.size()));
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return first[a] > first[b]; });
  order.resize(std::min(second_look, order.size()));
  const std::vector<std::size_t> second = counts_on(order, points.size());
  const auto most = std::max_element(second.begin(), second.end()) - second.begin();
  Plane plane = planes[order[static_cast<std::size_t>(most)]];
  for (int round = 0; round < 5; ++round) {
    const PlaneSpread spread =
        weighted_spread(points, plane.center, points_per_chunk, [&](const Eigen::Vector3d& point) {
          return std::abs(plane.height(point)) <= options.tolerance_m ? 1.0 : 0.0;
        });
    if (!is_plane(spread)) return std::nullopt;
    plane = plane_of(spread, up);
  }
  return plane;
}

struct Candidate {
  Plane plane;
  Points points;  // inliers
};

std::vector<Candidate> find_candidates(Points points, const GroundPlaneOptions& options,
                                       const Eigen::Vector3d& up, double& largest_fraction) {
  const auto total = static_cast<double>(points.size());
  RandomStream random(options.seed, hypotheses_stream);
  std::vector<Candidate> candidates;
  for (int round = 0; round < max_rounds && points.size() >= 3; ++round) {
    const std::optional<Plane> plane = best_plane(points, options, up, random);
    if (!plane) break;
    Candidate candidate{*plane, {}};
    Points rest;
    for (const Eigen::Vector3d& point : points) {
      const double height = std::abs(plane->height(point));
      if (height <= options.tolerance_m) candidate.points.push_back(point);
      // Points slightly beyond the tolerance are noise of the plane.
      if (height > 2.0 * options.tolerance_m) rest.push_back(point);
    }
    points = std::move(rest);
    // The fit rotated towards a wall or slope that intersects the plane.
    if (degrees_between(plane->normal, up) > options.max_tilt_deg) continue;
    const double fraction = static_cast<double>(candidate.points.size()) / total;
    largest_fraction = std::max(largest_fraction, fraction);
    const double least =
        std::max(options.min_fraction, options.min_fraction_of_largest * largest_fraction);
    if (candidate.points.size() < 3 || fraction < least) break;
    candidates.push_back(std::move(candidate));
  }
  return candidates;
}

double fraction_above(const Plane& plane, const Points& points) {
  std::size_t above = 0;
  for (const Eigen::Vector3d& point : points) above += plane.height(point) > 0.0 ? 1U : 0U;
  return static_cast<double>(above) / static_cast<double>(points.size());
}

// True if `other` is below `ground`, the plane with more points.
bool is_below(const Candidate& other, const Candidate& ground, const Eigen::Vector3d& up,
              double tolerance) {
  const double above_other = fraction_above(other.plane, ground.points);
  const double above_ground = fraction_above(ground.plane, other.points);
  if (std::abs(above_other - above_ground) > 0.25) return above_other > above_ground;
  // The planes meet in a ridge or a valley.
  const double tilt_of_other = degrees_between(other.plane.normal, up);
  const double tilt_of_ground = degrees_between(ground.plane.normal, up);
  if (std::abs(tilt_of_other - tilt_of_ground) > 5.0) return tilt_of_other < tilt_of_ground;
  return up.dot(ground.plane.center - other.plane.center) > tolerance;
}

// Iterated least squares with Tukey's biweight (Beaton and Tukey 1974). The scale is the median
// deviation of the inliers.
Plane fit_robustly(const Points& points, Plane plane, const Eigen::Vector3d& up, double tolerance) {
  Points near;
  for (const Eigen::Vector3d& point : points)
    if (std::abs(plane.height(point)) <= 3.0 * tolerance) near.push_back(point);
  const double exact = 1e-12 * (1.0 + bounds_of(near).max.cwiseAbs().maxCoeff() +
                                bounds_of(near).min.cwiseAbs().maxCoeff());
  std::vector<double> deviations;
  for (int round = 0; round < 100; ++round) {
    deviations.clear();
    for (const Eigen::Vector3d& point : near) {
      const double height = std::abs(plane.height(point));
      if (height <= tolerance) deviations.push_back(height);
    }
    if (deviations.size() < 3) return plane;
    const double limit = std::clamp(tukey_width_of(median(std::move(deviations))),
                                    std::min(100.0 * exact, tolerance), tolerance);
    const PlaneSpread spread =
        weighted_spread(near, plane.center, points_per_chunk, [&](const Eigen::Vector3d& point) {
          const double ratio = plane.height(point) / limit;
          return tukey_weight(ratio);
        });
    if (!is_plane(spread)) return plane;
    const Plane fitted = plane_of(spread, up);
    const double moved = std::abs(fitted.height(plane.center)) +
                         (fitted.normal - plane.normal).norm() * std::sqrt(spread.variances[2]);
    plane = fitted;
    if (moved <= exact) break;
  }
  return plane;
}

void require_ranges(const GroundPlaneOptions& options) {
  check_parameters(options);
  if (!options.up.allFinite() || !(options.up.norm() > 0.0))
    throw Error("not a direction", {.field = "up", .bound = "finite and not zero"});
}

// Random sample of at most max_drawn points, in random order.
Points drawn_points(const Points& points, std::uint64_t seed) {
  RandomStream random(seed, points_stream);
  Points drawn;
  if (points.size() <= max_drawn) {
    drawn = points;
    for (std::size_t n = drawn.size(); n > 1; --n) std::swap(drawn[n - 1], drawn[random.below(n)]);
    return drawn;
  }
  for (std::size_t n = 0; n < max_drawn; ++n) drawn.push_back(points[random.below(points.size())]);
  return drawn;
}

void require_plane_spread(const Points& points) {
  if (points.size() < 3)
    throw Error("too few points for a ground plane",
                {.field = "points", .value = std::to_string(points.size()), .bound = ">= 3"});
  const PlaneSpread spread = weighted_spread(points, points.front(), points_per_chunk,
                                             [](const Eigen::Vector3d&) { return 1.0; });
  if (!is_plane(spread))
    throw Error("all are on one line, so they define no ground plane", {.field = "points"});
}

std::string percent(double fraction) { return to_fixed_text(100.0 * fraction, 1) + " %"; }

// Suggests an option with which there is a ground plane, for example a larger tolerance.
std::string remedy(const Points& points, const GroundPlaneOptions& options,
                   const Eigen::Vector3d& up) {
  GroundPlaneOptions rougher = options;
  double fraction = 0.0;
  for (int doubling = 0; doubling < 5; ++doubling) {
    rougher.tolerance_m *= 2.0;
    if (!find_candidates(drawn_points(points, options.seed), rougher, up, fraction).empty())
      return "for natural terrain use --plane-tolerance " + to_text(rougher.tolerance_m);
  }
  // The ground may be steeper, or z may not be up.
  const Eigen::Vector3d normal =
      plane_of(weighted_spread(points, points.front(), points_per_chunk,
                               [](const Eigen::Vector3d&) { return 1.0; }),
               up)
          .normal;
  if (!find_candidates(drawn_points(points, options.seed), options, normal, fraction).empty()) {
    const auto text = [](double value) { return to_fixed_text(value, 2); };
    return "use the normal of the points, --up " + text(normal.x()) + "," + text(normal.y()) + "," +
           text(normal.z()) + ", or its opposite";
  }
  return "use --level none with --box or --polygon to keep the frame's z";
}

}  // namespace

void bind(ParameterTable& table, GroundPlaneOptions& options) {
  constexpr Range fraction{0.0, 1.0, true, false};
  table.add("plane_tolerance_m", options.tolerance_m, positive,
            "maximum distance between a plane and the points that belong to the plane, m");
  table.add("max_tilt_deg", options.max_tilt_deg, {0.0, 90.0, true, true},
            "maximum angle between the ground's normal and the up direction, degrees");
  table.add_former_key("min_ground_share", "min_ground_fraction");
  table.add("min_ground_fraction", options.min_fraction, fraction,
            "minimum share of the cloud's points, or of the mesh's area, on the ground plane");
  table.add_former_key("min_share_of_largest", "min_fraction_of_largest");
  table.add(
      "min_fraction_of_largest", options.min_fraction_of_largest, fraction,
      "minimum size, relative to the largest plane, of a lower plane that is taken as the ground");
  table.add("plane_hypotheses", options.hypotheses, {1.0, 1e6},
            "number of random planes, each through three points, that are tried to find one plane");
  table.add("seed", options.seed, not_negative, "random seed of the search for the ground plane");
}

GroundPlane find_ground_plane(const std::vector<Eigen::Vector3d>& points,
                              const GroundPlaneOptions& options) {
  require_ranges(options);
  const Eigen::Vector3d up = options.up.normalized();
  require_plane_spread(points);
  double largest_fraction = 0.0;
  const std::vector<Candidate> candidates =
      find_candidates(drawn_points(points, options.seed), options, up, largest_fraction);
  if (candidates.empty())
    throw Error("no plane within " + to_text(options.max_tilt_deg) + " degrees of up, (" +
                    to_text(up.x()) + ", " + to_text(up.y()) + ", " + to_text(up.z()) +
                    "), is large enough to be the ground: " + remedy(points, options, up),
                {.field = "share of the points on the largest plane",
                 .value = percent(largest_fraction),
                 .bound = ">= " + percent(options.min_fraction)});
  const Candidate* ground = &candidates.front();
  for (const Candidate& other : candidates)
    if (&other != ground && is_below(other, *ground, up, options.tolerance_m)) ground = &other;
  const Plane plane = fit_robustly(points, ground->plane, up, options.tolerance_m);
  GroundPlane result;
  result.normal = plane.normal;
  double squares = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    const double height = plane.height(point);
    if (std::abs(height) > options.tolerance_m) continue;
    ++result.inliers;
    squares += height * height;
    sum += point - plane.center;
  }
  const auto count = static_cast<double>(result.inliers);
  result.center = plane.center;
  if (result.inliers > 0) {
    result.rmse_m = std::sqrt(squares / count);
    const Eigen::Vector3d mean = sum / count;
    result.center += mean - plane.normal.dot(mean) * plane.normal;
  }
  result.offset_m = result.normal.dot(result.center);
  result.fraction = count / static_cast<double>(points.size());
  result.tilt_deg = degrees_between(result.normal, up);
  return result;
}

Pose level_from_map(const GroundPlane& plane) {
  const Eigen::Vector3d pivot =
      plane.center - (plane.normal.dot(plane.center) - plane.offset_m) * plane.normal;
  Pose level = Pose::Identity();
  level.linear() = shortest_rotation(plane.normal, Eigen::Vector3d::UnitZ());
  level.translation() = Eigen::Vector3d(pivot.x(), pivot.y(), 0.0) - level.linear() * pivot;
  return level;
}

}  // namespace libmap
