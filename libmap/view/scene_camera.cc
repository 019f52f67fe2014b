#include "libmap/view/scene_camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

constexpr double oblique_field_of_view_deg = 30.0;
constexpr double free_border = 0.05;  // border on each side, relative to the plot

void orient(SceneCamera& camera, const Eigen::Vector3d& forward, const Eigen::Vector3d& up) {
  camera.forward = forward.normalized();
  camera.right = camera.forward.cross(up).normalized();
  camera.up = camera.right.cross(camera.forward);
}

struct Interval {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();
  void add(double value) {
    min = std::min(min, value);
    max = std::max(max, value);
  }
  double middle() const { return min + (max - min) / 2.0; }
  double length() const { return max - min; }
};

void fit_orthographic(SceneCamera& camera, const std::vector<Eigen::Vector3d>& points,
                      double radius_m) {
  Interval across, along, depth;
  for (const Eigen::Vector3d& point : points) {
    across.add(point.dot(camera.right));
    along.add(point.dot(camera.up));
    depth.add(point.dot(camera.forward));
  }
  const double usable = 1.0 - 2.0 * free_border;
  const double width_m = std::max(across.length() + 2.0 * radius_m, 1e-9);
  const double height_m = std::max(along.length() + 2.0 * radius_m, 1e-9);
  camera.scale_px = usable * std::min(camera.plot.width / width_m, camera.plot.height / height_m);
  const double back_off = depth.length() + std::max(width_m, height_m);
  camera.position = across.middle() * camera.right + along.middle() * camera.up +
                    (depth.min - back_off) * camera.forward;
}

// One image direction of the perspective fit. A point at offset a in this direction and f along the
// view is visible from the camera at offset c and distance d if |a - c| <= (f + d) t. Thus d t + c
// and d t - c each have a lower bound, a maximum over all points.
struct HalfPlanes {
  double plus = -std::numeric_limits<double>::infinity();   // max(a - f t)
  double minus = -std::numeric_limits<double>::infinity();  // max(-a - f t)
  void add(double a, double f, double radius_m, double t) {
    plus = std::max(plus, a + radius_m - f * t);
    minus = std::max(minus, -a + radius_m - f * t);
  }
  double distance(double t) const { return (plus + minus) / (2.0 * t); }
};

// The feasible offset at distance d that centers the projected points.
double centered_offset(const std::vector<Eigen::Vector2d>& offsets_and_depths,
                       const HalfPlanes& bounds, double d, double t) {
  double c = (bounds.plus - bounds.minus) / 2.0;
  for (int round = 0; round < 8; ++round) {
    Interval seen;
    for (const Eigen::Vector2d& point : offsets_and_depths)
      seen.add((point.x() - c) / (point.y() + d));
    c = std::clamp(c + seen.middle() * d, bounds.plus - d * t,
                   std::max(bounds.plus - d * t, d * t - bounds.minus));
  }
  return c;
}

void fit_perspective(SceneCamera& camera, const std::vector<Eigen::Vector3d>& points,
                     double radius_m) {
  const double usable = 1.0 - 2.0 * free_border;
  const double tangent_across = usable * camera.plot.width / (2.0 * camera.scale_px);
  const double tangent_along = usable * camera.plot.height / (2.0 * camera.scale_px);
  const Eigen::Vector3d& origin = points.front();
  std::vector<Eigen::Vector2d> offsets_across, offsets_along;
  HalfPlanes across, along;
  Interval depth;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d offset = point - origin;
    const double f = offset.dot(camera.forward);
    offsets_across.emplace_back(offset.dot(camera.right), f);
    offsets_along.emplace_back(offset.dot(camera.up), f);
    across.add(offsets_across.back().x(), f, radius_m, tangent_across);
    along.add(offsets_along.back().x(), f, radius_m, tangent_along);
    depth.add(f);
  }
  // The camera must be in front of the nearest point.
  const double distance = std::max({across.distance(tangent_across), along.distance(tangent_along),
                                    -depth.min + 2.0 * radius_m + 1e-9});
  camera.position =
      origin + centered_offset(offsets_across, across, distance, tangent_across) * camera.right +
      centered_offset(offsets_along, along, distance, tangent_along) * camera.up -
      distance * camera.forward;
}

void place(SceneCamera& camera, const CameraPlacement& placement) {
  const Eigen::Vector3d view = placement.focal_point - placement.position;
  if (!view.allFinite() || !(view.norm() > 0.0))
    throw Error("position and focal point coincide or are not finite", {.field = "camera"});
  const double sine = view.normalized().cross(placement.up.normalized()).norm();
  if (!(sine > 1e-6))
    throw Error("the up direction is parallel to the view direction, or zero",
                {.field = "camera up"});
  const double angle = placement.field_of_view_deg;
  if (!(angle > 0.0 && angle < 180.0))
    throw Error("invalid field of view",
                {.field = "field_of_view_deg", .value = to_text(angle), .bound = "> 0 and < 180"});
  orient(camera, view, placement.up);
  camera.position = placement.position;
}

}  // namespace

std::vector<std::pair<std::string, Viewpoint>> viewpoint_names() {
  return {{"top", Viewpoint::top},
          {"oblique", Viewpoint::oblique},
          {"front", Viewpoint::front},
          {"side", Viewpoint::side},
          {"camera", Viewpoint::camera}};
}

Eigen::Vector2d SceneCamera::pixel_of(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d offset = point - position;
  const double scale = pixels_per_m(offset.dot(forward));
  return {plot.left + plot.width / 2.0 + scale * offset.dot(right),
          plot.top + plot.height / 2.0 - scale * offset.dot(up)};
}

SceneCamera fit_camera(Viewpoint view, const CameraPlacement& placement,
                       const std::vector<Eigen::Vector3d>& points, double radius_m,
                       const PixelRect& plot) {
  SceneCamera camera;
  camera.plot = plot;
  camera.perspective = view == Viewpoint::oblique || view == Viewpoint::camera;
  if (camera.perspective) {
    const double angle_deg =
        view == Viewpoint::camera ? placement.field_of_view_deg : oblique_field_of_view_deg;
    camera.scale_px = plot.height / 2.0 / std::tan(angle_deg / 2.0 * std::numbers::pi / 180.0);
  }
  switch (view) {
    case Viewpoint::top:
      orient(camera, -Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitY());
      break;
    case Viewpoint::front:
      orient(camera, Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ());
      break;
    case Viewpoint::side:
      orient(camera, -Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ());
      break;
    case Viewpoint::oblique:
      orient(camera, Eigen::Vector3d(0.5, 1.0, -0.85), Eigen::Vector3d::UnitZ());
      break;
    case Viewpoint::camera:
      place(camera, placement);
      return camera;
  }
  if (camera.perspective)
    fit_perspective(camera, points, radius_m);
  else
    fit_orthographic(camera, points, radius_m);
  return camera;
}

}  // namespace libmap
