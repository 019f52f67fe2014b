#include "libmap/scenes/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

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
  // Archimedes: a zone of a sphere has the area of its circumscribed cylinder.
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
  // Meusnier: 1 / rho times the cosine between the normals of circle and surface.
  return normal_rho == 0.0 ? 0.0 : normal_rho / at.x();
}

double ProfileSegment::t_of_area_fraction(double t0, double t1, double fraction) const {
  const Eigen::Vector2d p0 = point(t0);
  const Eigen::Vector2d p1 = point(t1);
  if (is_arc) {
    const double cosine = (p0.y() + fraction * (p1.y() - p0.y()) - center_a) / radius;
    const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
    return std::clamp((angle - angle_start) / (angle_end - angle_start), t0, t1);
  }
  const double difference = p1.x() - p0.x();
  if (std::abs(difference) <= 1e-12 * (p0.x() + p1.x())) return t0 + fraction * (t1 - t0);
  const double rho = std::sqrt(p0.x() * p0.x() + fraction * (p1.x() * p1.x() - p0.x() * p0.x()));
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

namespace {

using std::numbers::pi;

// Probe length along a normal, and tolerance of touching surfaces, m.
constexpr double probe_m = 1e-6;
constexpr double touching_m = 1e-9;

Profile profile_of(const Sphere& sphere) {
  return {ProfileSegment::arc(0.0, sphere.radius_m, 0.0, pi)};
}

Profile profile_of(const Capsule& capsule) {
  const double half = 0.5 * capsule.length_m - capsule.radius_m;
  const double r = capsule.radius_m;
  Profile profile = {ProfileSegment::arc(half, r, 0.0, 0.5 * pi)};
  if (half > 0.0) profile.push_back(ProfileSegment::line({r, half}, {r, -half}));
  profile.push_back(ProfileSegment::arc(-half, r, 0.5 * pi, pi));
  return profile;
}

Profile profile_of(const Cone& cone) {
  return {ProfileSegment::line({0.0, cone.height_m}, {cone.radius_m, 0.0}),
          ProfileSegment::line({cone.radius_m, 0.0}, {0.0, 0.0})};
}

Profile profile_of(const Cylinder& cylinder) {
  const double r = cylinder.radius_m;
  const double h = cylinder.height_m;
  return {ProfileSegment::line({0.0, h}, {r, h}), ProfileSegment::line({r, h}, {r, 0.0}),
          ProfileSegment::line({r, 0.0}, {0.0, 0.0})};
}

// solid_from_face of the face of a box with the normal `sign` * `axis`.
Pose box_face_pose(int axis, double sign, double distance) {
  Pose pose = Pose::Identity();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  normal[axis] = sign;
  Eigen::Vector3d along = Eigen::Vector3d::Zero();
  along[(axis + 1) % 3] = 1.0;
  pose.linear().col(0) = along;
  pose.linear().col(1) = normal.cross(along);
  pose.linear().col(2) = normal;
  pose.translation() = distance * normal;
  return pose;
}

// Initializes `solid` from a geometry and its pose; one overload per kind.
struct SolidMaker {
  SceneSolid& solid;
  const Pose& pose;

  void revolve(Profile profile, double middle_a, double bound) const {
    solid.profile = std::move(profile);
    solid.scene_from_solid = pose;
    solid.bound_center = solid.scene_from_solid * Eigen::Vector3d(0.0, 0.0, middle_a);
    solid.bound_radius = bound;
  }
  void operator()(const Sphere& sphere) const { revolve(profile_of(sphere), 0.0, sphere.radius_m); }
  void operator()(const Capsule& capsule) const {
    revolve(profile_of(capsule), 0.0, 0.5 * capsule.length_m);
    // The profile's z axis is the capsule's x axis.
    solid.scene_from_solid.linear().col(0) = pose.linear().col(1);
    solid.scene_from_solid.linear().col(1) = pose.linear().col(2);
    solid.scene_from_solid.linear().col(2) = pose.linear().col(0);
  }
  void operator()(const Cone& cone) const {
    revolve(profile_of(cone), 0.5 * cone.height_m, std::hypot(cone.radius_m, 0.5 * cone.height_m));
  }
  void operator()(const Cylinder& cylinder) const {
    revolve(profile_of(cylinder), 0.5 * cylinder.height_m,
            std::hypot(cylinder.radius_m, 0.5 * cylinder.height_m));
  }
  void operator()(const Box& box) const {
    solid.half_size = 0.5 * Eigen::Vector3d(box.size_x_m, box.size_y_m, box.size_z_m);
    solid.scene_from_solid = pose * Eigen::Translation3d(0.0, 0.0, solid.half_size.z());
    for (const int axis : {0, 1, 2})
      for (const double sign : {-1.0, 1.0})
        solid.faces.push_back(
            {solid.scene_from_solid * box_face_pose(axis, sign, solid.half_size[axis]),
             solid.half_size[(axis + 1) % 3], solid.half_size[(axis + 2) % 3]});
    solid.bound_center = solid.scene_from_solid.translation();
    solid.bound_radius = solid.half_size.norm();
  }
  void operator()(const Plane& plane) const {
    solid.is_plane = true;
    solid.scene_from_solid = pose;
    solid.faces.push_back({pose, 0.5 * plane.size_x_m, 0.5 * plane.size_y_m});
    solid.bound_center = pose.translation();
    solid.bound_radius = std::numeric_limits<double>::infinity();
  }
  void operator()(const Bump&) const {}
};

// Radial height function: h(r), h'(r) / r and h''(r).
struct RadialHeight {
  double value = 0.0;
  double slope_over_r = 0.0;
  double second = 0.0;
};

RadialHeight radial_height(const Bump& bump, double r) {
  const double h = bump.height_m;
  if (bump.profile == BumpProfile::gaussian) {
    const double inverse_variance = 9.0 / (bump.radius_m * bump.radius_m);
    const double value = h * std::exp(-0.5 * r * r * inverse_variance);
    return {value, -value * inverse_variance,
            value * inverse_variance * (r * r * inverse_variance - 1.0)};
  }
  if (r >= bump.radius_m) return {};
  const double k = pi / bump.radius_m;
  const double angle = k * r;
  const double cosine = std::cos(0.5 * angle);
  const double sinc = angle < 1e-8 ? 1.0 : std::sin(angle) / angle;
  return {h * cosine * cosine, -0.5 * h * k * k * sinc, -0.5 * h * k * k * std::cos(angle)};
}

// Principal curvatures of a height field, ascending, positive if convex as seen from above: the
// eigenvalues of the shape operator in an orthonormal frame of the tangent plane.
std::pair<double, double> height_field_curvatures(const GroundHeight& ground) {
  const Eigen::Vector2d& g = ground.gradient;
  const double w = std::sqrt(1.0 + g.squaredNorm());
  // Cholesky factor of the first fundamental form I = L L^T.
  const double l00 = std::sqrt(1.0 + g.x() * g.x());
  const double l10 = g.x() * g.y() / l00;
  const double l11 = w / l00;
  Eigen::Matrix2d inverse;
  inverse << 1.0 / l00, 0.0, -l10 / (l00 * l11), 1.0 / l11;
  const Eigen::Matrix2d shape = -inverse * (ground.hessian / w) * inverse.transpose();
  const double mean = 0.5 * (shape(0, 0) + shape(1, 1));
  const double spread = std::hypot(0.5 * (shape(0, 0) - shape(1, 1)), shape(0, 1));
  return {mean - spread, mean + spread};
}

// Signed distance to a box from the excess along each axis; exact, negative inside.
double box_distance(const Eigen::Vector3d& excess) {
  const double inside = excess.maxCoeff();
  return inside <= 0.0 ? inside : excess.cwiseMax(0.0).norm();
}

}  // namespace

SceneGeometry::SceneGeometry(const PrimitiveScene& scene) {
  scene.check();
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const SceneShape& shape = scene.shapes[i];
    if (std::holds_alternative<Bump>(shape.geometry)) continue;
    SceneSolid solid;
    solid.shape = static_cast<int>(i);
    const Pose pose = shape.placement.pose();
    std::visit(SolidMaker{solid, pose}, shape.geometry);
    solid.solid_from_scene = solid.scene_from_solid.inverse(Eigen::Isometry);
    if (solid.is_plane && ground_ < 0) {
      solid.is_ground = true;
      ground_ = static_cast<int>(solids_.size());
    }
    solids_.push_back(std::move(solid));
  }
  add_bumps(scene);
}

void SceneGeometry::add_bumps(const PrimitiveScene& scene) {
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const Bump* bump = std::get_if<Bump>(&scene.shapes[i].geometry);
    if (bump == nullptr) continue;
    const Eigen::Vector3d center =
        ground()->solid_from_scene * scene.shapes[i].placement.pose().translation();
    bumps_.push_back({*bump, center.head<2>(), static_cast<int>(i)});
  }
}

GroundHeight SceneGeometry::ground_height(double x, double y) const {
  GroundHeight sum;
  for (const PlacedBump& placed : bumps_) {
    const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - placed.center;
    const double r = offset.norm();
    const RadialHeight radial = radial_height(placed.bump, r);
    sum.value += radial.value;
    sum.gradient += radial.slope_over_r * offset;
    const Eigen::Vector2d outward = r > 0.0 ? Eigen::Vector2d(offset / r) : offset;
    sum.hessian += radial.slope_over_r * Eigen::Matrix2d::Identity() +
                   (radial.second - radial.slope_over_r) * outward * outward.transpose();
  }
  return sum;
}

double SceneGeometry::signed_distance(const SceneSolid& solid, const Eigen::Vector3d& point) const {
  const Eigen::Vector3d local = solid.solid_from_scene * point;
  if (!solid.profile.empty())
    return profile_signed_distance(solid.profile, {local.head<2>().norm(), local.z()});
  if (!solid.is_plane) return box_distance(local.cwiseAbs() - solid.half_size);
  const FlatFace& face = solid.faces.front();
  double above = local.z();
  if (solid.is_ground && has_bumps()) {
    const GroundHeight ground = ground_height(local.x(), local.y());
    above = (above - ground.value) / std::sqrt(1.0 + ground.gradient.squaredNorm());
  }
  return box_distance(
      {std::abs(local.x()) - face.half_x, std::abs(local.y()) - face.half_y, above});
}

double SceneGeometry::height_of(const Eigen::Vector3d& point) const {
  return ground() == nullptr ? point.z() : (ground()->solid_from_scene * point).z();
}

SurfaceTruth SceneGeometry::on_profile(const SceneSolid& solid, std::size_t segment_index, double t,
                                       double angle) const {
  const ProfileSegment& segment = solid.profile[segment_index];
  const Eigen::Vector2d at = segment.point(t);
  const Eigen::Vector2d normal = segment.normal_at(at);
  const Eigen::Vector2d around(std::cos(angle), std::sin(angle));
  SurfaceTruth truth;
  truth.position =
      solid.scene_from_solid * Eigen::Vector3d(at.x() * around.x(), at.x() * around.y(), at.y());
  truth.normal = solid.scene_from_solid.linear() *
                 Eigen::Vector3d(normal.x() * around.x(), normal.x() * around.y(), normal.y());
  const double along = segment.curvature_along();
  const double across = segment.curvature_around(at);
  truth.curvature_min = std::min(along, across);
  truth.curvature_max = std::max(along, across);
  truth.height = height_of(truth.position);
  truth.shape = solid.shape;
  return truth;
}

int SceneGeometry::ground_shape_at(double x, double y) const {
  int shape = ground()->shape;
  double most = 0.0;
  for (const PlacedBump& placed : bumps_) {
    const double r = (Eigen::Vector2d(x, y) - placed.center).norm();
    if (r >= placed.bump.radius_m) continue;
    const double lift = std::abs(radial_height(placed.bump, r).value);
    if (lift <= most) continue;
    most = lift;
    shape = placed.shape;
  }
  return shape;
}

void SceneGeometry::bend_to_ground(const SceneSolid& solid, double x, double y,
                                   SurfaceTruth& truth) const {
  const GroundHeight height = ground_height(x, y);
  truth.position = solid.scene_from_solid * Eigen::Vector3d(x, y, height.value);
  truth.normal = solid.scene_from_solid.linear() *
                 Eigen::Vector3d(-height.gradient.x(), -height.gradient.y(), 1.0).normalized();
  std::tie(truth.curvature_min, truth.curvature_max) = height_field_curvatures(height);
  truth.height = height.value;
  truth.shape = ground_shape_at(x, y);
}

SurfaceTruth SceneGeometry::on_face(const SceneSolid& solid, const FlatFace& face, double x,
                                    double y) const {
  SurfaceTruth truth;
  if (solid.is_ground && has_bumps()) {
    bend_to_ground(solid, x, y, truth);
    return truth;
  }
  truth.position = face.scene_from_face * Eigen::Vector3d(x, y, 0.0);
  truth.normal = face.scene_from_face.linear().col(2);
  truth.height = solid.is_ground ? 0.0 : height_of(truth.position);
  truth.shape = solid.shape;
  return truth;
}

bool SceneGeometry::is_hidden_by(const SceneSolid& solid, const SceneSolid& other,
                                 const Eigen::Vector3d& position,
                                 const Eigen::Vector3d& normal) const {
  if ((position - other.bound_center).norm() > other.bound_radius + 2.0 * probe_m) return false;
  const double distance = signed_distance(other, position);
  if (distance < -touching_m) return true;
  if (distance > touching_m) return false;
  if (signed_distance(other, position + probe_m * normal) < -0.5 * probe_m) return true;
  const bool same_face = signed_distance(other, position + probe_m * normal) > 0.5 * probe_m &&
                         signed_distance(other, position - probe_m * normal) < -0.5 * probe_m;
  return same_face && other.shape < solid.shape;
}

bool SceneGeometry::is_visible(const SceneSolid& solid, const Eigen::Vector3d& position,
                               const Eigen::Vector3d& normal) const {
  return std::none_of(solids_.begin(), solids_.end(), [&](const SceneSolid& other) {
    return &other != &solid && is_hidden_by(solid, other, position, normal);
  });
}

void require_count(double count, std::uint64_t max_count, const std::string& what,
                   const std::string& field, const std::string& value) {
  const auto text = [](double number) {
    const double rounded = std::round(number);
    return rounded < 9e18 ? to_text(static_cast<std::int64_t>(rounded)) : to_text(rounded);
  };
  const auto limit = static_cast<double>(max_count);
  if (count > limit)
    throw Error("would create about " + text(count) + " " + what + "; the limit max_" + what +
                    " is " + text(limit),
                {.field = field, .value = value});
}

}  // namespace libmap
