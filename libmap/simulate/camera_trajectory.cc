#include "libmap/simulate/camera_trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

using std::numbers::pi;

constexpr double first_stamp_s = 1.7e9;
constexpr double pace_step = 1e-3;  // integration step of the path length, loops

// Smooth random function of time with mean 0 and standard deviation 1: a sum of waves with random
// frequencies in a band and random phases.
class SmoothNoise {
 public:
  SmoothNoise(std::uint64_t seed, std::uint64_t key, double low_hz, double high_hz) {
    RandomStream random(seed, key);
    for (Wave& wave : waves_) {
      wave.rate = 2 * pi * random.uniform(low_hz, high_hz);
      wave.phase = random.uniform(0.0, 2 * pi);
    }
  }
  double at(double time_s) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += std::sin(wave.rate * time_s + wave.phase);
    return sum * std::sqrt(2.0 / static_cast<double>(waves_.size()));
  }

 private:
  struct Wave {
    double rate = 0.0;
    double phase = 0.0;
  };
  std::array<Wave, 6> waves_;
};

using Wander3 = std::array<SmoothNoise, 3>;
Wander3 wander3(std::uint64_t seed, std::uint64_t key, double low_hz, double high_hz) {
  return {SmoothNoise(seed, key, low_hz, high_hz), SmoothNoise(seed, key + 1, low_hz, high_hz),
          SmoothNoise(seed, key + 2, low_hz, high_hz)};
}
Eigen::Vector3d at(const Wander3& wander, double time_s) {
  return {wander[0].at(time_s), wander[1].at(time_s), wander[2].at(time_s)};
}

// Parameters of the loops, with defaults filled in.
struct CameraRoute {
  Eigen::Vector3d center;  // at ground height
  Eigen::Vector3d target;
  double radius = 0.0, last_radius = 0.0;
  double height = 0.0, last_height = 0.0;
  double start_deg = 0.0, sweep_deg = 0.0;
};

// Horizontal direction that a wall faces; nullopt for ground and closed surfaces.
std::optional<Eigen::Vector2d> facing_of_wall(const TriangleMesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Triangle& triangle : mesh.triangles) sum += 0.5 * area_normal(mesh, triangle);
  const bool closed = sum.norm() <= 0.3 * surface_area(mesh);
  if (closed || std::abs(sum.z()) > 0.7 * sum.norm()) return std::nullopt;
  return Eigen::Vector2d(sum.head<2>().normalized());
}

CameraRoute way_of(const TriangleMesh& mesh, const CameraTrajectoryOptions& options) {
  const Bounds3d bounds = bounds_of(mesh.vertices);
  const Eigen::Vector3d size = bounds.max - bounds.min;
  const std::optional<Eigen::Vector2d> facing = facing_of_wall(mesh);
  const auto or_fitted = [](double given, double fitted) { return given != 0 ? given : fitted; };
  CameraRoute way;
  way.center = 0.5 * (bounds.min + bounds.max);
  const double half_side =
      0.5 * (facing ? std::max(size.x(), size.y()) : size.head<2>().minCoeff());
  way.radius = or_fitted(options.radius_m, std::clamp(4.0 / 3.0 * half_side, 0.8, 2.0));
  way.last_radius = or_fitted(options.last_radius_m, 0.7 * way.radius);
  way.height = or_fitted(options.height_m, 0.6 * way.radius);
  way.last_height = or_fitted(options.last_height_m, 0.8 * way.radius);
  if (facing) {
    way.target = options.target.value_or(way.center);
    way.center.z() = bounds.min.z();
    way.sweep_deg = or_fitted(options.sweep_deg, 120.0);
    way.start_deg =
        options.start_deg + std::atan2(facing->y(), facing->x()) * 180.0 / pi - 0.5 * way.sweep_deg;
  } else {
    way.center.z() = surrounding_ground_height(mesh);
    way.target = options.target.value_or(way.center);
    way.sweep_deg = or_fitted(options.sweep_deg, 360.0);
    way.start_deg = options.start_deg;
  }
  return way;
}

// 0 on the first loop, 1 on the last. The transition between loops takes +-15 % of a loop.
double loop_fraction(double loop, int loops) {
  if (loops < 2) return 0.0;
  const double nearest_end = std::clamp(std::round(loop), 1.0, loops - 1.0);
  const double t = std::clamp((loop - nearest_end) / 0.3 + 0.5, 0.0, 1.0);
  return (nearest_end - 1.0 + t * t * (3.0 - 2.0 * t)) / (loops - 1.0);
}

// Position on the path without sway; `loop` is the number of loops from the start.
Eigen::Vector3d position_on(const CameraRoute& way, const CameraTrajectoryOptions& options,
                            double loop) {
  const double fraction = loop_fraction(loop, options.loops);
  const double radius = way.radius + fraction * (way.last_radius - way.radius);
  const double height = way.height + fraction * (way.last_height - way.height);
  double turns = loop;
  if (std::abs(way.sweep_deg) < 360.0) {
    const double phase = std::fmod(loop, 2.0);
    turns = phase <= 1.0 ? phase : 2.0 - phase;
  }
  const double angle = (way.start_deg + turns * way.sweep_deg) * pi / 180.0;
  return way.center + Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle), height);
}

// Body axes with x toward the target and y horizontal.
Eigen::Matrix3d look_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  Eigen::Vector3d forward = target - position;
  if (forward.norm() < 1e-9) forward = -Eigen::Vector3d::UnitZ();
  forward.normalize();
  Eigen::Vector3d left = Eigen::Vector3d::UnitZ().cross(forward);
  if (left.norm() < 1e-9) left = Eigen::Vector3d::UnitY();
  left.normalize();
  Eigen::Matrix3d axes;
  axes << forward, left, forward.cross(left);
  return axes;
}

// Loop parameters of the frames, at equal path lengths.
std::vector<double> paced_loops(const CameraRoute& way, const CameraTrajectoryOptions& options) {
  const auto steps = static_cast<std::size_t>(std::lround(options.loops / pace_step));
  std::vector<double> lengths{0.0};
  Eigen::Vector3d last = position_on(way, options, 0.0);
  for (std::size_t i = 1; i <= steps; ++i) {
    const Eigen::Vector3d here = position_on(way, options, pace_step * static_cast<double>(i));
    lengths.push_back(lengths.back() + (here - last).norm());
    last = here;
  }
  // The last frame is one step before the end, where a closed loop begins again.
  const double step_m = lengths.back() / options.frames;
  std::vector<double> loops;
  std::size_t i = 0;
  for (int n = 0; n < options.frames; ++n) {
    const double wanted = n * step_m;
    while (i + 2 < lengths.size() && lengths[i + 1] < wanted) ++i;
    const double span = lengths[i + 1] - lengths[i];
    const double part = span > 0 ? std::clamp((wanted - lengths[i]) / span, 0.0, 1.0) : 0.0;
    loops.push_back(pace_step * (static_cast<double>(i) + part));
  }
  return loops;
}

// Adds sway, tremor and gaze variation to a camera pose.
class HandMotion {
 public:
  // Sway and tremor have the frequencies of steps; gaze has periods of about ten seconds.
  HandMotion(const CameraTrajectoryOptions& options, double gaze_m, std::uint64_t seed)
      : sway_m_(options.sway_m),
        tremor_deg_(options.tremor_deg),
        gaze_m_(gaze_m),
        sway_(wander3(seed, 0, 0.4, 2.0)),
        turn_(wander3(seed, 3, 0.4, 2.0)),
        gaze_(wander3(seed, 6, 0.04, 0.15)) {}

  Pose pose(const Eigen::Vector3d& way, const Eigen::Vector3d& target, double time_s) const {
    const Eigen::Vector3d position = way + sway_m_ * at(sway_, time_s);
    // The gaze varies less in height than over the ground.
    const Eigen::Vector3d looked_at =
        target + gaze_m_ * Eigen::Vector3d(1.0, 1.0, 0.3).cwiseProduct(at(gaze_, time_s));
    Pose pose = make_pose_from_rpy(position, Eigen::Vector3d::Zero());
    pose.linear() = look_at(position, looked_at) *
                    make_pose_from_rpy({0, 0, 0}, tremor_deg_ * at(turn_, time_s)).linear();
    return pose;
  }

 private:
  double sway_m_;
  double tremor_deg_;
  double gaze_m_;
  Wander3 sway_;
  Wander3 turn_;
  Wander3 gaze_;
};

// Lanes along the longer side of a rectangle, joined by half circles.
class Serpentine {
 public:
  Serpentine(const Eigen::AlignedBox2d& box, const SerpentineOptions& options) {
    swapped_ = box.sizes().y() > box.sizes().x();
    low_ = in_lanes(box.min());
    const Eigen::Vector2d size = in_lanes(box.sizes());
    const double width = std::max(0.0, size.y() - 2.0 * options.border_m);
    lanes_ = 1 + static_cast<int>(std::ceil(width / options.lane_m - 1e-9));
    radius_ = lanes_ > 1 ? 0.5 * width / (lanes_ - 1) : 0.0;
    straight_ = std::max(0.0, size.x() - 2.0 * (options.border_m + radius_));
    low_ += Eigen::Vector2d(0.5 * (size.x() - straight_), 0.5 * (size.y() - width));
  }

  double length() const { return lanes_ * straight_ + (lanes_ - 1) * pi * radius_; }
  // Position at a path length from the start; extrapolated straight beyond both ends.
  Eigen::Vector2d at(double way_m) const {
    const double period = straight_ + pi * radius_;
    const int lane =
        period > 0.0 ? static_cast<int>(std::clamp(std::floor(way_m / period), 0.0, lanes_ - 1.0))
                     : 0;
    const double along = way_m - lane * period;
    const double forward = lane % 2 == 0 ? 1.0 : -1.0;
    Eigen::Vector2d in_plane(0.5 * straight_ + forward * (along - 0.5 * straight_),
                             2.0 * radius_ * lane);
    if (along > straight_ && lane + 1 < lanes_) {
      const double angle = (along - straight_) / radius_;
      in_plane.x() = 0.5 * straight_ * (1.0 + forward) + forward * radius_ * std::sin(angle);
      in_plane.y() += radius_ * (1.0 - std::cos(angle));
    }
    return in_lanes(low_ + in_plane);
  }

 private:
  Eigen::Vector2d in_lanes(const Eigen::Vector2d& xy) const {
    return swapped_ ? Eigen::Vector2d(xy.y(), xy.x()) : xy;
  }

  bool swapped_ = false;  // lanes are along y
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  int lanes_ = 1;
  double radius_ = 0.0;
  double straight_ = 0.0;
};

}  // namespace

void bind(ParameterTable& table, SerpentineOptions& options) {
  table.add("lane_m", options.lane_m, positive,
            "maximum distance between the lanes of a serpentine path, m");
  table.add("border_m", options.border_m, not_negative,
            "distance of a serpentine path from the border of the ground, m");
  table.add(
      "ahead_m", options.ahead_m, positive,
      "serpentine path: distance along the path from the camera to the viewed ground point, m");
}

void bind(ParameterTable& table, CameraTrajectoryOptions& options) {
  table.add("path", options.path,
            {{"auto", CameraPath::automatic},
             {"loops", CameraPath::loops},
             {"serpentine", CameraPath::serpentine}},
            "camera path; loops: around the site; serpentine: in parallel lanes; auto: loops for a "
            "mesh, serpentine for a cloud");
  bind(table, options.serpentine);
  table.add("frames", options.frames, {1.0, 1e6}, "number of frames along the camera path");
  table.add("loops", options.loops, {1.0, 1000.0}, "number of loops around the site");
  table.add("radius_m", options.radius_m, not_negative,
            "radius of the first loop around the site's center, m; 0: fitted to the mesh");
  table.add("last_radius_m", options.last_radius_m, not_negative,
            "radius of the last loop, m; 0: 0.7 times the first radius");
  table.add("height_m", options.height_m, not_negative,
            "camera height above the ground on the first loop or the serpentine path, m; 0: 0.6 "
            "times the radius of the loop, or 1.4 m");
  table.add("last_height_m", options.last_height_m, not_negative,
            "camera height on the last loop, m; 0: 0.8 times the first radius");
  table.add("start_deg", options.start_deg, any_number,
            "direction from the site's center to the start of the first loop, degrees "
            "counter-clockwise from x; at a wall: offset from the default start");
  table.add("sweep_deg", options.sweep_deg, {-360.0, 360.0},
            "angle swept by each loop, degrees; negative: clockwise; below 360, every second loop "
            "runs backwards; 0: 360, or 120 at a wall");
  table.add("gaze_deg", options.gaze_deg, {0.0, 45.0},
            "standard deviation of the angle between view direction and target, degrees");
  table.add("sway_m", options.sway_m, not_negative,
            "standard deviation of the camera position about the path, per axis, m");
  table.add("tremor_deg", options.tremor_deg, not_negative,
            "standard deviation of the camera rotation about each axis, degrees");
  table.add("frame_interval_s", options.frame_interval_s, positive, "time between two poses, s");
}

double surrounding_ground_height(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) throw no_elements("vertices of the mesh");
  const Bounds3d bounds = bounds_of(mesh.vertices);
  const Eigen::Vector3d inset = 0.1 * (bounds.max - bounds.min);
  std::vector<double> heights;
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (vertex.x() <= bounds.min.x() + inset.x() || vertex.x() >= bounds.max.x() - inset.x() ||
        vertex.y() <= bounds.min.y() + inset.y() || vertex.y() >= bounds.max.y() - inset.y())
      heights.push_back(vertex.z());
  return median(std::move(heights));
}

CameraMotion camera_motion(const TriangleMesh& mesh, const CameraTrajectoryOptions& options,
                           std::uint64_t seed) {
  const CameraRoute way = way_of(mesh, options);
  const HandMotion hand(options, way.radius * std::tan(options.gaze_deg * pi / 180.0), seed);
  return [=, loops = paced_loops(way, options)](std::size_t frame, double after_s) {
    const std::size_t last = std::max<std::size_t>(loops.size(), 2) - 2;
    const std::size_t step = std::min(frame, last);
    const double pace = loops.size() > 1 ? loops[step + 1] - loops[step] : 0.0;
    const double loop = loops[frame] + after_s / options.frame_interval_s * pace;
    const double time_s = static_cast<double>(frame) * options.frame_interval_s + after_s;
    return hand.pose(position_on(way, options, loop), way.target, time_s);
  };
}

CameraMotion serpentine_motion(const GroundHeights& ground, const CameraTrajectoryOptions& options,
                               std::uint64_t seed) {
  if (ground.empty()) throw no_elements("points of the terrain");
  const Serpentine way(ground.box(), options.serpentine);
  const double height_m = options.height_m > 0.0 ? options.height_m : 1.4;
  const double ahead_m = options.serpentine.ahead_m;
  const double gaze_m = std::hypot(height_m, ahead_m) * std::tan(options.gaze_deg * pi / 180.0);
  const HandMotion hand(options, gaze_m, seed);
  return [=, heights = ground](std::size_t frame, double after_s) {
    const double time_s = static_cast<double>(frame) * options.frame_interval_s + after_s;
    const double way_m = way.length() * time_s / (options.frame_interval_s * options.frames);
    const auto on_ground = [&](double at_m) {
      const Eigen::Vector2d in_plane = way.at(at_m);
      return Eigen::Vector3d(in_plane.x(), in_plane.y(), heights.height(in_plane));
    };
    return hand.pose(on_ground(way_m) + height_m * Eigen::Vector3d::UnitZ(),
                     on_ground(way_m + ahead_m), time_s);
  };
}

CameraMotion motion_through(Trajectory poses) {
  return [poses = std::move(poses)](std::size_t frame, double after_s) {
    const Pose& here = poses.at(frame).world_from_base;
    if (after_s == 0.0 || poses.size() < 2) return here;
    // Interpolates to the next pose; the motion of the last interval continues after the end.
    const std::size_t from = std::min(frame, poses.size() - 2);
    const double fraction = after_s / (poses[from + 1].stamp_s - poses[from].stamp_s);
    const Pose motion = poses[from].world_from_base.inverse() * poses[from + 1].world_from_base;
    const Eigen::AngleAxisd turn(motion.linear());
    Pose part = Pose::Identity();
    part.linear() = Eigen::AngleAxisd(fraction * turn.angle(), turn.axis()).toRotationMatrix();
    part.translation() = fraction * motion.translation();
    return here * part;
  };
}

Trajectory poses_of_motion(const CameraMotion& motion, const CameraTrajectoryOptions& options) {
  Trajectory trajectory;
  for (std::size_t n = 0; n < static_cast<std::size_t>(options.frames); ++n)
    trajectory.push_back({0, 0.0, motion(n, 0.0)});
  return assign_nodes_and_stamps(std::move(trajectory), options.frame_interval_s);
}

Trajectory assign_nodes_and_stamps(Trajectory poses, double frame_interval_s) {
  const bool stamped = std::any_of(poses.begin(), poses.end(),
                                   [](const TrajectoryPose& pose) { return pose.stamp_s != 0.0; });
  for (std::size_t n = 0; n < poses.size(); ++n) {
    TrajectoryPose& pose = poses[n];
    pose.node = static_cast<int>(n) + 1;
    if (!stamped) pose.stamp_s = first_stamp_s + static_cast<double>(n) * frame_interval_s;
    if (n > 0 && !(pose.stamp_s > poses[n - 1].stamp_s))
      throw Error("stamps of poses must ascend", {.field = "stamp of pose " + std::to_string(n + 1),
                                                  .value = to_text(pose.stamp_s),
                                                  .bound = "> " + to_text(poses[n - 1].stamp_s)});
  }
  return poses;
}

}  // namespace libmap
