#include "libgtd/grasp/finger_closing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

Eigen::Vector2d direction(double angle) { return {std::sin(angle), -std::cos(angle)}; }

// Link that rotates about a pivot. It starts at the distance `base` from the pivot, at the angle of
// the rotation, and is bent inward by `bend` from the line through the pivot.
struct TurningLink {
  Eigen::Vector2d pivot;
  double base = 0.0;
  double length = 0.0;
  double bend = 0.0;

  // Angle of the point at `along` on the link, behind the rotation.
  double lag(double along) const {
    return std::atan2(along * std::sin(bend), base + along * std::cos(bend));
  }
  double radius(double along) const {
    return std::hypot(along * std::sin(bend), base + along * std::cos(bend));
  }
};

struct LinkContact {
  double angle = -10.0;  // rotation
  double along = 0.0;    // m from the start of the link
  Eigen::Vector2d point{0.0, 0.0};
};

// Contact at the largest angle between `last` and `first`; the rotation descends from `first`.
class FirstContact {
 public:
  FirstContact(const TurningLink& link, double first, double last)
      : link_(link), first_(first), last_(last), reach_(link.radius(link.length)) {
    // A bent link is nearest to its pivot at the foot of the perpendicular.
    const double foot = std::clamp(-link.base * std::cos(link.bend), 0.0, link.length);
    nearest_ = std::min({link.base, reach_, link.radius(foot)});
  }

  void meet(const GroundSegment& segment) {
    const Eigen::Vector2d a = segment.a - link_.pivot;
    const Eigen::Vector2d b = segment.b - link_.pivot;
    meet_point(a);
    meet_point(b);
    meet_end(a, b);
  }

  const std::optional<LinkContact>& contact() const { return contact_; }

 private:
  void offer(double turn, double along, const Eigen::Vector2d& from_pivot) {
    if (turn > first_) turn -= 2.0 * std::numbers::pi;
    if (turn < last_ || turn > first_) return;
    if (contact_ && turn <= contact_->angle) return;
    contact_ = LinkContact{turn, along, from_pivot + link_.pivot};
  }

  static double angle_of(const Eigen::Vector2d& v) { return std::atan2(v.x(), -v.y()); }

  // Contact of the inside of the link with a corner of the profile.
  void meet_point(const Eigen::Vector2d& corner) {
    const double radius = corner.norm();
    // The pivot itself does not move.
    if (radius > std::max(reach_, link_.base) || radius < nearest_ || radius < 1e-9) return;
    const double half = link_.base * std::cos(link_.bend);
    const double root = half * half - link_.base * link_.base + radius * radius;
    if (root < 0.0) return;
    const double angle = angle_of(corner);
    for (const double along : {-half + std::sqrt(root), -half - std::sqrt(root)})
      if (along >= 0.0 && along <= link_.length) offer(angle + link_.lag(along), along, corner);
  }

  // Contact of the end of the link with the inside of a segment.
  void meet_end(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const Eigen::Vector2d d = b - a;
    const double dd = d.squaredNorm();
    if (dd == 0.0) return;
    const double half = a.dot(d) / dd;
    const double root = half * half - (a.squaredNorm() - reach_ * reach_) / dd;
    if (root < 0.0) return;
    for (const double fraction : {-half + std::sqrt(root), -half - std::sqrt(root)}) {
      if (fraction < 0.0 || fraction > 1.0) continue;
      const Eigen::Vector2d point = a + fraction * d;
      offer(angle_of(point) + link_.lag(link_.length), link_.length, point);
    }
  }

  const TurningLink link_;
  const double first_;
  const double last_;
  const double reach_;
  double nearest_ = 0.0;
  std::optional<LinkContact> contact_;
};

std::optional<LinkContact> first_contact(const TurningLink& link, double first, double last,
                                         std::span<const GroundSegment> profile) {
  FirstContact search(link, first, last);
  for (const GroundSegment& segment : profile) search.meet(segment);
  return search.contact();
}

// Raises `height` to the palm height at which the link from p to q is above the segment.
void rise_above(const Eigen::Vector2d& p, const Eigen::Vector2d& q, const GroundSegment& segment,
                std::optional<double>& height) {
  const auto [link_low, link_high] = std::minmax(p.x(), q.x());
  const auto [ground_low, ground_high] = std::minmax(segment.a.x(), segment.b.x());
  const double low = std::max(link_low, ground_low);
  const double high = std::min(link_high, ground_high);
  if (low > high) return;
  const auto at = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, double r) {
    if (a.x() == b.x()) return std::max(a.y(), b.y());
    return a.y() + (b.y() - a.y()) * ((r - a.x()) / (b.x() - a.x()));
  };
  for (const double r : {low, high}) {
    const double needed =
        at(segment.a, segment.b, r) - (p.x() == q.x() ? std::min(p.y(), q.y()) : at(p, q, r));
    height = std::max(height.value_or(needed), needed);
  }
}

}  // namespace

Eigen::Vector2d FingerGeometry::knuckle(double proximal_rad) const {
  return joint() + proximal_m * direction(proximal_rad);
}

Eigen::Vector2d FingerGeometry::tip(double proximal_rad, double curl) const {
  return knuckle(proximal_rad) + distal_m * direction(proximal_rad - curl);
}

FingerGeometry finger_geometry(const Gripper& gripper) {
  if (!gripper.fingers)
    throw libmap::Error("is missing: closing the gripper requires this section of the gripper file",
                        {.field = "fingers"});
  constexpr double radians = libmap::radians_per_degree;
  FingerGeometry finger;
  finger.joint_radius_m = 0.0005 * gripper.finger_joint_diameter_mm;
  finger.proximal_m = 0.001 * gripper.finger_length_mm;
  finger.distal_m = 0.001 * gripper.spine_length_mm;
  finger.opening_rad = radians * gripper.opening_angle_deg;
  finger.closing_rad = radians * gripper.closing_angle_deg;
  finger.curl_rad = radians * gripper.fingers->curl_deg;
  finger.curl_limit_rad = radians * gripper.fingers->curl_limit_deg;
  return finger;
}

FingerClosing close_finger(const FingerGeometry& finger, std::span<const GroundSegment> profile) {
  const TurningLink proximal{finger.joint(), 0.0, finger.proximal_m, 0.0};
  const TurningLink distal{finger.joint(), finger.proximal_m, finger.distal_m, finger.curl_rad};
  const auto on_proximal = first_contact(proximal, finger.opening_rad, finger.closing_rad, profile);
  const auto on_distal = first_contact(distal, finger.opening_rad, finger.closing_rad, profile);
  FingerClosing closing;
  closing.proximal_rad = finger.closing_rad;
  closing.curl_rad = finger.curl_rad;
  if (!on_proximal && !on_distal) return closing;
  const double outer_half = 0.5 * finger.distal_m;
  // A contact at the knuckle belongs to both links and stops the proximal link.
  if (on_distal && (!on_proximal || on_distal->angle > on_proximal->angle)) {
    closing.proximal_rad = on_distal->angle;
    const bool by_spines = on_distal->along >= outer_half;
    closing.outcome = by_spines ? FingerOutcome::spines : FingerOutcome::link;
    (by_spines ? closing.spines : closing.link) = on_distal->point;
    return closing;
  }
  closing.outcome = FingerOutcome::link;
  closing.proximal_rad = on_proximal->angle;
  closing.link = on_proximal->point;
  const double first = closing.proximal_rad - finger.curl_rad;
  const double last = closing.proximal_rad - finger.curl_limit_rad;
  const TurningLink alone{finger.knuckle(closing.proximal_rad), 0.0, finger.distal_m, 0.0};
  const auto contact = first_contact(alone, first, last, profile);
  closing.curl_rad = closing.proximal_rad - (contact ? contact->angle : last);
  if (contact && contact->along >= outer_half) {
    closing.outcome = FingerOutcome::spines;
    closing.spines = contact->point;
  }
  return closing;
}

std::optional<double> open_finger_height(const FingerGeometry& finger,
                                         std::span<const GroundSegment> profile) {
  const std::array<Eigen::Vector2d, 3> chain = {finger.joint(), finger.knuckle(finger.opening_rad),
                                                finger.tip(finger.opening_rad, finger.curl_rad)};
  std::optional<double> height;
  for (const GroundSegment& segment : profile) {
    rise_above(chain[0], chain[1], segment, height);
    rise_above(chain[1], chain[2], segment, height);
  }
  return height;
}

}  // namespace libgtd
