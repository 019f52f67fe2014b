#include "tests/libmap/scenes/scene_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace graspmap_test {

using namespace libmap;

namespace {

using std::numbers::pi;

constexpr double touching_m = 1e-9;

struct Roots {
  std::array<double, 2> values{};
  int count = 0;
};

// Real roots of a s^2 + 2 b s + c, without cancellation.
Roots solve_quadratic(double a, double b, double c, double scale) {
  Roots roots;
  if (std::abs(a) <= 1e-14 * scale) {
    if (b != 0.0) roots = {{-c / (2.0 * b), 0.0}, 1};
    return roots;
  }
  const double discriminant = b * b - a * c;
  if (discriminant < 0.0) return roots;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  roots.count = 2;
  roots.values = {q / a, q != 0.0 ? c / q : 0.0};
  return roots;
}

Roots line_hits(const ProfileSegment& segment, const Eigen::Vector3d& origin,
                const Eigen::Vector3d& direction) {
  const Eigen::Vector2d step = segment.end - segment.start;
  if (step.y() == 0.0) {
    if (direction.z() == 0.0) return {};
    return {{(segment.start.y() - origin.z()) / direction.z(), 0.0}, 1};
  }
  const double slope = step.x() / step.y();
  const double rho = segment.start.x() + slope * (origin.z() - segment.start.y());
  const double rho_step = slope * direction.z();
  const Eigen::Vector2d o = origin.head<2>();
  const Eigen::Vector2d d = direction.head<2>();
  return solve_quadratic(d.squaredNorm() - rho_step * rho_step, o.dot(d) - rho * rho_step,
                         o.squaredNorm() - rho * rho, 1.0);
}

Roots arc_hits(const ProfileSegment& segment, const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction) {
  const Eigen::Vector3d o = origin - Eigen::Vector3d(0.0, 0.0, segment.center_a);
  return solve_quadratic(direction.squaredNorm(), o.dot(direction),
                         o.squaredNorm() - segment.radius * segment.radius, 1.0);
}

bool lies_on(const ProfileSegment& segment, const Eigen::Vector2d& point, double tolerance) {
  if (segment.is_arc) {
    const double low = segment.center_a + segment.radius * std::cos(segment.angle_end);
    const double high = segment.center_a + segment.radius * std::cos(segment.angle_start);
    return point.y() >= low - tolerance && point.y() <= high + tolerance;
  }
  const Eigen::Vector2d low = segment.start.cwiseMin(segment.end);
  const Eigen::Vector2d high = segment.start.cwiseMax(segment.end);
  return (point.array() >= low.array() - tolerance).all() &&
         (point.array() <= high.array() + tolerance).all();
}

// Last intersection of a line with the solid: the largest s with origin + s * direction on the
// surface, and its segment.
struct ProfileHit {
  double s = 0.0;
  std::size_t segment = 0;
};
bool last_hit(const Profile& profile, const Eigen::Vector3d& origin,
              const Eigen::Vector3d& direction, ProfileHit& hit);

bool last_hit(const Profile& profile, const Eigen::Vector3d& origin,
              const Eigen::Vector3d& direction, ProfileHit& hit) {
  bool found = false;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const ProfileSegment& segment = profile[i];
    const Roots roots = segment.is_arc ? arc_hits(segment, origin, direction)
                                       : line_hits(segment, origin, direction);
    for (int k = 0; k < roots.count; ++k) {
      const double s = roots.values[static_cast<std::size_t>(k)];
      const Eigen::Vector3d at = origin + s * direction;
      const Eigen::Vector2d in_profile(at.head<2>().norm(), at.z());
      // Wide enough that no line slips through a seam.
      if (!lies_on(segment, in_profile, 1e-12 * (1.0 + origin.norm()))) continue;
      if (found && s <= hit.s) continue;
      hit = {s, i};
      found = true;
    }
  }
  return found;
}

double steepest_slope(const Bump& bump) {
  const double ratio = std::abs(bump.height_m) / bump.radius_m;
  // At half the radius; at one standard deviation.
  return bump.profile == BumpProfile::cosine ? 0.5 * pi * ratio : 3.0 * std::exp(-0.5) * ratio;
}

std::optional<double> ground_hit(const SceneGeometry& geometry, const SceneSolid& solid,
                                 const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  if (!solid.is_ground || !geometry.has_bumps()) return -origin.z() / direction.z();
  double top = 0.0;
  double bottom = 0.0;
  double steepest = 0.0;
  for (const SceneGeometry::PlacedBump& placed : geometry.bumps()) {
    (placed.bump.height_m > 0.0 ? top : bottom) += placed.bump.height_m;
    steepest += steepest_slope(placed.bump);
  }
  // Descend from above all bumps by steps that cannot pass the surface.
  const double rate = direction.z() + steepest * direction.head<2>().norm();
  double s = (top - origin.z()) / direction.z();
  double above = 0.0;
  for (int step = 0; step < 100'000; ++step) {
    const Eigen::Vector3d at = origin + s * direction;
    if (at.z() < bottom - 1e-9) return std::nullopt;
    above = at.z() - geometry.ground_height(at.x(), at.y()).value;
    if (above < 1e-9) break;
    s -= above / rate;
  }
  for (int step = 0; step < 4; ++step) {
    const Eigen::Vector3d at = origin + s * direction;
    const GroundHeight height = geometry.ground_height(at.x(), at.y());
    const double derivative = direction.z() - height.gradient.dot(direction.head<2>());
    if (derivative > 1e-6) s -= (at.z() - height.value) / derivative;
  }
  return s;
}

std::optional<SurfaceTruth> highest_on(const SceneGeometry& geometry, const SceneSolid& solid,
                                       double x, double y) {
  const auto line_in = [&](const Pose& frame_from_scene) {
    return std::pair<Eigen::Vector3d, Eigen::Vector3d>(
        frame_from_scene * Eigen::Vector3d(x, y, 0.0),
        frame_from_scene.linear() * Eigen::Vector3d::UnitZ());
  };
  if (!solid.profile.empty()) {
    const auto [origin, direction] = line_in(solid.solid_from_scene);
    ProfileHit hit;
    if (!last_hit(solid.profile, origin, direction, hit)) return std::nullopt;
    const Eigen::Vector3d at = origin + hit.s * direction;
    const ProfileSegment& segment = solid.profile[hit.segment];
    double t = 0.0;
    if (segment.is_arc) {
      const double angle = std::atan2(at.head<2>().norm(), at.z() - segment.center_a);
      t = (angle - segment.angle_start) / (segment.angle_end - segment.angle_start);
    } else {
      const Eigen::Vector2d step = segment.end - segment.start;
      t = (Eigen::Vector2d(at.head<2>().norm(), at.z()) - segment.start).dot(step) /
          step.squaredNorm();
    }
    return geometry.on_profile(solid, hit.segment, std::clamp(t, 0.0, 1.0),
                               std::atan2(at.y(), at.x()));
  }
  std::optional<SurfaceTruth> highest;
  for (const FlatFace& face : solid.faces) {
    const auto [origin, direction] = line_in(face.scene_from_face.inverse(Eigen::Isometry));
    if (direction.z() <= 1e-12) continue;
    const std::optional<double> s = ground_hit(geometry, solid, origin, direction);
    if (!s) continue;
    const Eigen::Vector3d at = origin + *s * direction;
    const double slack = 1e-12 * (1.0 + origin.norm());
    if (std::abs(at.x()) > face.half_x + slack || std::abs(at.y()) > face.half_y + slack) continue;
    const SurfaceTruth truth = geometry.on_face(solid, face, at.x(), at.y());
    if (!highest || truth.position.z() > highest->position.z()) highest = truth;
  }
  return highest;
}

}  // namespace

std::optional<SurfaceTruth> from_above(const SceneGeometry& geometry, double x, double y) {
  std::optional<SurfaceTruth> highest;
  for (const SceneSolid& solid : geometry.solids()) {
    const std::optional<SurfaceTruth> truth = highest_on(geometry, solid, x, y);
    if (truth && (!highest || truth->position.z() > highest->position.z() + touching_m))
      highest = truth;
  }
  return highest;
}

double distance_to_scene(const libmap::SceneGeometry& geometry, const Eigen::Vector3d& point) {
  double distance = std::numeric_limits<double>::infinity();
  for (const libmap::SceneSolid& solid : geometry.solids())
    distance = std::min(distance, geometry.signed_distance(solid, point));
  return distance;
}

}  // namespace graspmap_test
