#include "libmap/simulate/scene_profile.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace libmap {

namespace {

using std::numbers::pi;

}  // namespace

ProfileSegment ProfileSegment::line(Eigen::Vector2d start, Eigen::Vector2d end) {
  ProfileSegment segment;
  segment.start = std::move(start);
  segment.end = std::move(end);
  return segment;
}

ProfileSegment ProfileSegment::arc(double center_a, double radius, double angle_start,
                                   double angle_end) {
  ProfileSegment segment;
  segment.is_arc = true;
  segment.center_a = center_a;
  segment.radius = radius;
  segment.angle_start = angle_start;
  segment.angle_end = angle_end;
  return segment;
}

double ProfileSegment::length() const {
  return is_arc ? radius * (angle_end - angle_start) : (end - start).norm();
}

double ProfileSegment::area() const { return area_between(0.0, 1.0); }

double ProfileSegment::area_between(double t0, double t1) const {
  const Eigen::Vector2d p0 = point(t0);
  const Eigen::Vector2d p1 = point(t1);
  // Archimedes: a zone of a sphere has the area of the cylinder around it.
  if (is_arc) return 2.0 * pi * radius * (p0.y() - p1.y());
  return pi * (p0.x() + p1.x()) * length() * (t1 - t0);
}

Eigen::Vector2d ProfileSegment::point(double t) const {
  if (!is_arc) return start + t * (end - start);
  const double angle = angle_start + t * (angle_end - angle_start);
  return {radius * std::sin(angle), center_a + radius * std::cos(angle)};
}

Eigen::Vector2d ProfileSegment::normal_at(const Eigen::Vector2d& at) const {
  if (is_arc) return (at - Eigen::Vector2d(0.0, center_a)).normalized();
  const Eigen::Vector2d step = (end - start).normalized();
  return {-step.y(), step.x()};
}

double ProfileSegment::curvature_along() const { return is_arc ? 1.0 / radius : 0.0; }

double ProfileSegment::curvature_around(const Eigen::Vector2d& at) const {
  if (is_arc) return 1.0 / radius;
  const double normal_rho = normal_at(at).x();
  // Meusnier: the circle of radius rho, seen under the angle of its normal to the surface's.
  return normal_rho == 0.0 ? 0.0 : normal_rho / at.x();
}

double ProfileSegment::t_of_area_share(double t0, double t1, double share) const {
  const Eigen::Vector2d p0 = point(t0);
  const Eigen::Vector2d p1 = point(t1);
  if (is_arc) {
    const double cosine = (p0.y() + share * (p1.y() - p0.y()) - center_a) / radius;
    const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
    return std::clamp((angle - angle_start) / (angle_end - angle_start), t0, t1);
  }
  const double difference = p1.x() - p0.x();
  if (std::abs(difference) <= 1e-12 * (p0.x() + p1.x())) return t0 + share * (t1 - t0);
  const double rho = std::sqrt(p0.x() * p0.x() + share * (p1.x() * p1.x() - p0.x() * p0.x()));
  return t0 + (rho - p0.x()) / difference * (t1 - t0);
}

double ProfileSegment::distance(const Eigen::Vector2d& from) const {
  if (is_arc) {
    const Eigen::Vector2d offset = from - Eigen::Vector2d(0.0, center_a);
    const double angle = std::atan2(offset.x(), offset.y());
    if (angle >= angle_start && angle <= angle_end) return std::abs(offset.norm() - radius);
    return std::min((from - point(0.0)).norm(), (from - point(1.0)).norm());
  }
  const Eigen::Vector2d step = end - start;
  const double t = std::clamp((from - start).dot(step) / step.squaredNorm(), 0.0, 1.0);
  return (from - (start + t * step)).norm();
}

bool ProfileSegment::is_beyond(const Eigen::Vector2d& at) const {
  if (!is_arc) return (at - start).dot(normal_at(at)) > 0.0;
  const Eigen::Vector2d offset = at - Eigen::Vector2d(0.0, center_a);
  const double angle = std::atan2(offset.x(), offset.y());
  return angle >= angle_start && angle <= angle_end && offset.norm() > radius;
}

double profile_signed_distance(const Profile& profile, const Eigen::Vector2d& point) {
  double distance = std::numeric_limits<double>::infinity();
  bool outside = false;
  for (const ProfileSegment& segment : profile) {
    distance = std::min(distance, segment.distance(point));
    outside = outside || segment.is_beyond(point);
  }
  return outside ? distance : -distance;
}

}  // namespace libmap
