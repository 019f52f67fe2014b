#include "libgtd/grasp/gripper_closing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "libgtd/gripper/target_clones.h"

namespace libgtd {

namespace {

// Clearance of the open gripper at rest, so that a closing finger meets the ground from outside.
constexpr double clearance_m = 1e-5;

// Sets bit `finger` of each vertex that is not to the right of the plane of a finger.
GRASPMAP_CLONED_CHOICE void mark_left(const double* xs, const double* ys,
                                      const Eigen::Vector2d& along, std::size_t finger,
                                      std::uint64_t* is_left, std::size_t size) {
  const double x = along.x();
  const double y = along.y();
  for (std::size_t v = 0; v < size; ++v)
    is_left[v] |= static_cast<std::uint64_t>(x * ys[v] - y * xs[v] >= 0.0) << finger;
}

// Vertices of the patch in the frame of a gripper, with their side of the planes of all fingers and
// of the sides of the palm's square. Most triangles do not intersect a plane and are not below the
// palm; three numbers show this for all fingers at once.
struct CarriedVertices {
  std::vector<double> x, y, z;
  std::vector<std::uint64_t> is_left;  // one bit per finger
  std::vector<std::uint8_t> beyond;    // one bit per side

  CarriedVertices(const GroundPatch& patch, const Eigen::Isometry3d& gripper_from_patch,
                  const std::vector<Eigen::Vector2d>& along, double palm_radius)
      : is_left(patch.vertices.size(), 0) {
    for (std::vector<double>* axis : {&x, &y, &z}) axis->reserve(patch.vertices.size());
    beyond.reserve(patch.vertices.size());
    for (const Eigen::Vector3d& vertex : patch.vertices) {
      const Eigen::Vector3d here = gripper_from_patch * vertex;
      x.push_back(here.x());
      y.push_back(here.y());
      z.push_back(here.z());
      beyond.push_back(static_cast<std::uint8_t>(
          (here.x() > palm_radius ? 1 : 0) | (here.x() < -palm_radius ? 2 : 0) |
          (here.y() > palm_radius ? 4 : 0) | (here.y() < -palm_radius ? 8 : 0)));
    }
    for (std::size_t n = 0; n < along.size(); ++n)
      mark_left(x.data(), y.data(), along[n], n, is_left.data(), x.size());
  }
  Eigen::Vector3d operator[](std::size_t v) const { return {x[v], y[v], z[v]}; }
};

// Adds the intersection of triangle t with the half plane of a finger, which starts slightly behind
// the palm's axis. The triangle must have vertices on both sides of the plane.
void add_cut(const GroundPatch& patch, const CarriedVertices& vertices, const Eigen::Vector3d& axis,
             const Eigen::Vector2d& along, const FingerGeometry& finger, std::uint32_t t,
             std::vector<GroundSegment>& profile) {
  const double farthest = finger.joint_radius_m + finger.proximal_m + finger.distal_m;
  std::array<Eigen::Vector3d, 3> corners;
  std::array<double, 3> side{};  // distances from the plane
  for (std::size_t n = 0; n < 3; ++n) {
    corners[n] = vertices[patch.triangles[t][n]];
    side[n] = along.x() * corners[n].y() - along.y() * corners[n].x();
  }
  // The vertex that is alone on its side, and the two others.
  const std::size_t lone = (side[1] >= 0.0) == (side[2] >= 0.0)   ? 0
                           : (side[0] >= 0.0) == (side[2] >= 0.0) ? 1
                                                                  : 2;
  const auto cut = [&](std::size_t other) {
    const double fraction = side[lone] / (side[lone] - side[other]);
    const Eigen::Vector3d point = corners[lone] + fraction * (corners[other] - corners[lone]);
    return Eigen::Vector2d(along.dot(point.head<2>()), point.z());
  };
  GroundSegment segment{cut((lone + 1) % 3), cut((lone + 2) % 3), t,
                        patch.area_normals[t].dot(axis) > 0.0};
  const auto [low, high] = std::minmax(segment.a.x(), segment.b.x());
  if (low <= farthest && high >= -finger.distal_m) profile.push_back(segment);
}

// Maximum height of a triangle over the disc of this radius around the origin; nullopt: none.
std::optional<double> height_over_disc(const std::array<Eigen::Vector3d, 3>& corners,
                                       double radius) {
  std::optional<double> height;
  const auto offer = [&](double z) { height = std::max(height.value_or(z), z); };
  const double square = radius * radius;
  for (std::size_t n = 0; n < 3; ++n) {
    const Eigen::Vector3d& p = corners[n];
    const Eigen::Vector3d edge = corners[(n + 1) % 3] - p;
    if (p.head<2>().squaredNorm() <= square) offer(p.z());
    // |p + share * edge| = radius
    const double dd = edge.head<2>().squaredNorm();
    if (dd == 0.0) continue;
    const double half = p.head<2>().dot(edge.head<2>()) / dd;
    const double root = half * half - (p.head<2>().squaredNorm() - square) / dd;
    if (root < 0.0) continue;
    for (const double fraction : {-half - std::sqrt(root), -half + std::sqrt(root)})
      if (fraction >= 0.0 && fraction <= 1.0) offer(p.z() + fraction * edge.z());
  }
  // Highest point of the circle on the plane of the triangle, if it is on the triangle.
  const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  const double slope = normal.head<2>().norm();
  if (normal.z() == 0.0) return height;
  const Eigen::Vector2d top =
      slope > 0.0
          ? Eigen::Vector2d(-normal.head<2>() / (slope * std::copysign(1.0, normal.z())) * radius)
          : Eigen::Vector2d(0.0, 0.0);
  const double sign = std::copysign(1.0, normal.z());
  for (std::size_t n = 0; n < 3; ++n) {
    const Eigen::Vector2d from = corners[n].head<2>();
    const Eigen::Vector2d edge = corners[(n + 1) % 3].head<2>() - from;
    const Eigen::Vector2d way = top - from;
    if (sign * (edge.x() * way.y() - edge.y() * way.x()) < 0.0) return height;
  }
  offer(corners[0].z() - normal.head<2>().dot(top - corners[0].head<2>()) / normal.z());
  return height;
}

// Ground that the palm and the fingers may touch.
struct GroundCuts {
  std::optional<double> palm_m;  // contact height of the palm's disc, below the start
  std::vector<std::vector<GroundSegment>> profiles;  // one per finger
};

GroundCuts cuts_of(const GroundPatch& patch, const CarriedVertices& vertices,
                   const Eigen::Vector3d& axis, const std::vector<Eigen::Vector2d>& along,
                   const FingerGeometry& finger, double palm_radius, double start_m) {
  GroundCuts cuts;
  cuts.profiles.resize(along.size());
  for (std::uint32_t t = 0; t < patch.triangles.size(); ++t) {
    const auto [a, b, c] = patch.triangles[t];
    std::uint64_t crossed =
        (vertices.is_left[a] ^ vertices.is_left[b]) | (vertices.is_left[b] ^ vertices.is_left[c]);
    for (; crossed != 0; crossed &= crossed - 1) {
      const auto n = static_cast<std::size_t>(std::countr_zero(crossed));
      add_cut(patch, vertices, axis, along[n], finger, t, cuts.profiles[n]);
    }
    if ((vertices.beyond[a] & vertices.beyond[b] & vertices.beyond[c]) != 0) continue;
    const auto [low, high] = std::minmax({vertices.z[a], vertices.z[b], vertices.z[c]});
    if (low > start_m || (cuts.palm_m && high <= *cuts.palm_m)) continue;
    if (const auto over = height_over_disc({vertices[a], vertices[b], vertices[c]}, palm_radius))
      cuts.palm_m = std::max(cuts.palm_m.value_or(*over), *over);
  }
  return cuts;
}

// Returns true if ground that faces the palm is above `start_m` without a ceiling between, so that
// the finger starts inside the ground. Removes segments above `start_m` from the profile.
bool is_blocked(std::vector<GroundSegment>& profile, const FingerGeometry& finger, double start_m) {
  const auto is_above = [&](const GroundSegment& segment) {
    return std::min(segment.a.y(), segment.b.y()) > start_m;
  };
  const double tip = finger.tip(finger.opening_rad, finger.curl_rad).x();
  bool blocked = false;
  for (const GroundSegment& top : profile) {
    if (!top.faces_palm || !is_above(top)) continue;
    const Eigen::Vector2d middle = 0.5 * (top.a + top.b);
    if (middle.x() < finger.joint_radius_m || middle.x() > tip) continue;
    const bool has_ceiling =
        std::any_of(profile.begin(), profile.end(), [&](const GroundSegment& other) {
          const auto [low, high] = std::minmax(other.a.x(), other.b.x());
          return !other.faces_palm && low <= middle.x() && middle.x() <= high &&
                 std::min(other.a.y(), other.b.y()) < middle.y() && is_above(other);
        });
    blocked |= !has_ceiling;
  }
  std::erase_if(profile, is_above);
  return blocked;
}

// Computes ClosedFinger::unseen from the union of the segments of the profile.
double unseen_fraction(const GroundPatch& patch, const std::vector<GroundSegment>& profile,
                       double tip_radius) {
  std::vector<std::pair<double, double>> spans;
  for (const GroundSegment& segment : profile)
    if (segment.faces_palm && std::min(segment.a.y(), segment.b.y()) < 0.0 &&
        (patch.is_unscanned.empty() || patch.is_unscanned[segment.triangle] == 0))
      spans.push_back(std::minmax(segment.a.x(), segment.b.x()));
  std::sort(spans.begin(), spans.end());
  double seen = 0.0;
  double end = 0.0;
  for (const auto& [low, high] : spans) {
    const double from = std::max(low, end);
    const double to = std::min(high, tip_radius);
    if (to <= from) continue;
    seen += to * to - from * from;
    end = to;
  }
  const double unseen = 1.0 - seen / (tip_radius * tip_radius);
  constexpr double rounding = 1e-9;
  return unseen > rounding ? unseen : 0.0;
}

Eigen::Isometry3d patch_from_palm(const ApproachPose& pose) {
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.translation() = Eigen::Vector3d(pose.offset_m.x(), pose.offset_m.y(), 0.0);
  const double tilt = pose.tilt_rad.norm();
  if (tilt > 0.0)
    frame.rotate(
        Eigen::AngleAxisd(tilt, Eigen::Vector3d(pose.tilt_rad.x(), pose.tilt_rad.y(), 0.0) / tilt));
  frame.rotate(Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()));
  return frame;
}

// Adds the contacts of a closed finger.
void add_contacts(const GroundPatch& patch, std::size_t number, const ClosingOptions& options,
                  ClosedGripper& gripper) {
  const ClosedFinger& finger = gripper.fingers[number];
  const Eigen::Vector3d outward(std::cos(finger.azimuth_rad), std::sin(finger.azimuth_rad), 0.0);
  const auto in_patch = [&](const Eigen::Vector2d& v) -> Eigen::Vector3d {
    return v.x() * outward + v.y() * Eigen::Vector3d::UnitZ();
  };
  const Eigen::Matrix3d rotation = gripper.patch_from_gripper.linear();
  for (const bool by_spines : {false, true}) {
    const auto& touch = by_spines ? finger.closing.spines : finger.closing.link;
    if (!touch) continue;
    GripContact contact;
    contact.finger = number;
    contact.by_spines = by_spines;
    contact.point = gripper.patch_from_gripper * in_patch(*touch);
    const auto normal = patch.normal_at(contact.point, options.normal_radius_m);
    if (!normal) continue;
    contact.normal = *normal;
    contact.outward = rotation * outward;
    // Normal in the plane of the finger, a quarter turn inward; inward for ground that faces
    // sideways.
    const Eigen::Vector3d axis = rotation.col(2);
    const Eigen::Vector3d drag =
        contact.normal.dot(contact.outward) * axis - contact.normal.dot(axis) * contact.outward;
    contact.drag = drag.norm() < 1e-6 ? -contact.outward : drag.normalized();
    gripper.contacts.push_back(contact);
  }
}

}  // namespace

void bind(libmap::ParameterTable& table, ClosingOptions& options) {
  table.add("start_height_m", options.start_height_m, {0.0, 10.0, true, false},
            "height of the palm above the location at the start of the approach, m");
  table.add("normal_radius_m", options.normal_radius_m, {1e-5, 0.1},
            "radius within which the ground normal at a contact is averaged, m");
  table.add("max_unseen", options.max_unseen, libmap::zero_to_one,
            "maximum fraction of unmeasured or inaccurate ground below a finger; above it, the "
            "finger has no contacts");
}

GroundPatch patch_around(const Ground& ground, const Eigen::Vector3d& location,
                         const Eigen::Vector3d& away, const Gripper& gripper, double offset_m,
                         double tilt_rad, const ClosingOptions& options) {
  const FingerGeometry finger = finger_geometry(gripper);
  const double reach = finger.proximal_m + finger.distal_m;
  const double radius = std::max(finger.joint_radius_m + reach, 0.0005 * gripper.palm_diameter_mm) +
                        offset_m + options.normal_radius_m;
  return ground.patch(location, away, radius / std::cos(tilt_rad), options.start_height_m + reach,
                      std::tan(tilt_rad));
}

ClosedGripper close_gripper(const GroundPatch& patch, const Gripper& gripper,
                            const ApproachPose& pose, const ClosingOptions& options) {
  const FingerGeometry finger = finger_geometry(gripper);
  const int count = gripper.fingers->count;
  ClosedGripper closed;
  closed.patch_from_gripper = patch_from_palm(pose);
  const Eigen::Vector3d axis = closed.patch_from_gripper.linear().col(2);
  std::vector<Eigen::Vector2d> along;  // directions of the planes of the fingers
  for (int n = 0; n < count; ++n) {
    const double azimuth = 2.0 * std::numbers::pi * n / count;
    along.emplace_back(std::cos(azimuth), std::sin(azimuth));
  }
  const double palm_radius = 0.0005 * gripper.palm_diameter_mm;
  const CarriedVertices vertices(patch, closed.patch_from_gripper.inverse(), along, palm_radius);
  auto [palm, profiles] =
      cuts_of(patch, vertices, axis, along, finger, palm_radius, options.start_height_m);
  std::optional<double> height = palm;
  for (std::vector<GroundSegment>& profile : profiles) {
    if (is_blocked(profile, finger, options.start_height_m)) {
      closed.approach = ApproachOutcome::blocked;
      return closed;
    }
    if (const auto needed = open_finger_height(finger, profile))
      height = std::max(height.value_or(*needed), *needed);
  }
  if (!height) {
    closed.unseen = 1.0;
    return closed;
  }
  closed.approach = ApproachOutcome::on_ground;
  closed.palm_touches = palm && *palm >= *height;
  *height += clearance_m;
  closed.patch_from_gripper.translate(Eigen::Vector3d(0.0, 0.0, *height));
  const double tip = finger.tip(finger.opening_rad, finger.curl_rad).x();
  for (int n = 0; n < count; ++n) {
    auto& profile = profiles[static_cast<std::size_t>(n)];
    for (GroundSegment& segment : profile) {
      segment.a.y() -= *height;
      segment.b.y() -= *height;
    }
    ClosedFinger one;
    one.azimuth_rad = 2.0 * std::numbers::pi * n / count;
    one.unseen = unseen_fraction(patch, profile, tip);
    one.closing = close_finger(finger, profile);
    closed.unseen += one.unseen / count;
    closed.fingers.push_back(one);
    if (one.unseen <= options.max_unseen)
      add_contacts(patch, static_cast<std::size_t>(n), options, closed);
  }
  return closed;
}

}  // namespace libgtd
