#include "libmap/simulate/scan_events.h"

#include <cmath>

#include "libmap/scenes/solid.h"
#include "libmap/simulate/camera_trajectory.h"
#include "libmap/simulate/robot_cameras.h"

namespace libmap {

namespace {

const Eigen::Vector3d walker_radii(0.25, 0.18, 0.85);
const Eigen::Vector3d stone_radii(0.15, 0.12, 0.1);
constexpr double stone_shift_m = 0.4;
constexpr double ceiling_m = 2.5;
constexpr double ceiling_half_m = 8.0;
constexpr double upward_deg = -100.0;  // rotation about y from a view of the ground

// Returns true if `frame` (from 0) is one of `count` frames beginning with `first` (from 1).
bool is_within(std::size_t frame, int first, double count) {
  const double after = static_cast<double>(frame) + 1.0 - first;
  return first > 0 && after >= 0.0 && after < count;
}

TriangleMesh ellipsoid(const Eigen::Vector3d& radii_m) {
  Solid solid = ellipsoid_solid(radii_m, 0.1 * radii_m.maxCoeff());
  TriangleMesh mesh;
  mesh.vertices = std::move(solid.vertices);
  mesh.triangles = std::move(solid.triangles);
  return mesh;
}

Pose at_position(const Eigen::Vector3d& position) {
  return make_pose_from_rpy(position, Eigen::Vector3d::Zero());
}

// A checkered pattern: distinct colors with image features.
TriangleMesh walker() {
  TriangleMesh mesh = ellipsoid(walker_radii);
  for (const Eigen::Vector3d& p : mesh.vertices) {
    const auto check = std::lround(p.z() / 0.12) + std::lround(std::atan2(p.y(), p.x()) / 0.5);
    mesh.vertex_colors.push_back(check % 2 == 0 ? Color{200, 40, 40} : Color{40, 60, 170});
  }
  return mesh;
}

TriangleMesh ceiling() {
  TriangleMesh mesh;
  const double h = ceiling_half_m;
  mesh.vertices = {{-h, -h, 0.0}, {-h, h, 0.0}, {h, h, 0.0}, {h, -h, 0.0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.vertex_colors.assign(4, Color{225, 225, 220});
  return mesh;
}

}  // namespace

void bind(ParameterTable& table, ScanEvents& events) {
  table.add("walker_first_frame", events.walker_first_frame, not_negative,
            "first frame of a person walking across the site; 0: no person");
  table.add("walker_frames", events.walker_frames, {1}, "number of frames with the walking person");
  table.add("stone_moved_frame", events.stone_moved_frame, not_negative,
            "first frame after a loose stone has moved; 0: no stone");
  table.add("sun_first_frame", events.sun_first_frame, not_negative,
            "first frame with sunlight that limits the depth range; 0: never");
  table.add("sun_far_m", events.sun_far_m, positive, "maximum measured depth in sunlight, m");
  table.add("ceiling_first_frame", events.ceiling_first_frame, not_negative,
            "first frame in which the camera views a plain ceiling; 0: never");
  table.add("ceiling_frames", events.ceiling_frames, {1}, "number of frames with the ceiling");
}

bool ScanEvents::looks_up(std::size_t frame) const {
  return is_within(frame, ceiling_first_frame, ceiling_frames);
}

Pose ScanEvents::seen_pose(const Pose& world_from_body, std::size_t frame) const {
  if (!looks_up(frame)) return world_from_body;
  return world_from_body *
         make_pose_from_rpy(Eigen::Vector3d::Zero(), Eigen::Vector3d(0.0, upward_deg, 0.0));
}

double ScanEvents::far_at(std::size_t frame, double far_m) const {
  return is_within(frame, sun_first_frame, HUGE_VAL) ? std::min(far_m, sun_far_m) : far_m;
}

std::vector<ExtraBody> extra_bodies(const TriangleMesh& mesh, const ScanEvents& events,
                                    std::uint64_t seed) {
  std::vector<ExtraBody> bodies;
  const auto add = [&](const TriangleMesh& body, TextureSource texture, auto pose_at) {
    bodies.push_back({std::make_shared<VisibleSurface>(body, texture, seed + 1), pose_at});
  };
  const Bounds3d bounds = bounds_of(mesh.vertices);
  const Eigen::Vector3d middle = 0.5 * (bounds.min + bounds.max);
  if (events.walker_first_frame > 0) {
    const double ground = surrounding_ground_height(mesh);
    const double length = bounds.max.y() - bounds.min.y();
    add(walker(), TextureSource::mesh, [=](std::size_t frame) -> std::optional<Pose> {
      if (!is_within(frame, events.walker_first_frame, events.walker_frames)) return std::nullopt;
      const double fraction =
          (static_cast<double>(frame) + 1.5 - events.walker_first_frame) / events.walker_frames;
      return at_position(
          {middle.x(), bounds.min.y() + fraction * length, ground + walker_radii.z()});
    });
  }
  if (events.stone_moved_frame > 0) {
    const auto lying_at = [&](double x) {
      return at_position(
          {x, middle.y(), ground_height(mesh, x, middle.y()) + 0.8 * stone_radii.z()});
    };
    const Pose before = lying_at(middle.x() - 0.5 * stone_shift_m);
    const Pose after = lying_at(middle.x() + 0.5 * stone_shift_m);
    add(ellipsoid(stone_radii), TextureSource::rock, [=](std::size_t frame) {
      return std::optional(is_within(frame, events.stone_moved_frame, HUGE_VAL) ? after : before);
    });
  }
  if (events.ceiling_first_frame > 0) {
    const Pose pose =
        at_position({middle.x(), middle.y(), surrounding_ground_height(mesh) + ceiling_m});
    add(ceiling(), TextureSource::mesh, [=](std::size_t) { return std::optional(pose); });
  }
  return bodies;
}

void merge_nearer(SurfaceView& view, const SurfaceView& other) {
  const auto is_nearer = [](float depth, float than) {
    return depth > 0.0F && (than <= 0.0F || depth < than);
  };
  for (std::size_t n = 0; n < view.depth.pixels.size(); ++n) {
    if (!is_nearer(other.depth.pixels[n], view.depth.pixels[n])) continue;
    view.depth.pixels[n] = other.depth.pixels[n];
    view.incidence_cos.pixels[n] = other.incidence_cos.pixels[n];
    if (!view.color.empty()) view.color.pixels[n] = other.color.pixels[n];
  }
  for (std::size_t n = 0; n < view.corner_depth.pixels.size(); ++n)
    if (is_nearer(other.corner_depth.pixels[n], view.corner_depth.pixels[n]))
      view.corner_depth.pixels[n] = other.corner_depth.pixels[n];
}

}  // namespace libmap
