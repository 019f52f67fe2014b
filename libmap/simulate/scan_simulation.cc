#include "libmap/simulate/scan_simulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "libmap/camera/depth_correction.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/simulate/sensor_faults.h"

namespace libmap {

namespace {

constexpr double degrees = 180.0 / std::numbers::pi;
// Number of frames that are rendered in parallel.
constexpr std::size_t batch = 8;
constexpr double far_deviations = 6.0;  // rendered margin beyond far_m, in deviations of noise

// Keys of the random streams; each frame uses four keys from `frame_key` on.
constexpr std::uint64_t trajectory_key = 1;
constexpr std::uint64_t odometry_key = 2;
constexpr std::uint64_t closure_key = 3;
constexpr std::uint64_t fault_key = 4;
constexpr std::uint64_t recording_key = 5;
constexpr std::uint64_t frame_key = 1000;

double turn_of(const Pose& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

// A link with an error drawn from the covariance of its information matrix.
PoseLink noisy_link(int from, int to, LinkType type, const Pose& true_motion, double error_m,
                    double error_deg, RandomStream random) {
  PoseLink link{.from = from, .to = to, .type = type};
  Eigen::Vector3d shift;
  Eigen::Vector3d turn_deg;
  for (Eigen::Index axis = 0; axis < 3; ++axis) shift[axis] = error_m * random.normal();
  for (Eigen::Index axis = 0; axis < 3; ++axis) turn_deg[axis] = error_deg * random.normal();
  link.from_from_to = true_motion * make_pose_from_rpy(shift, turn_deg);
  const double error_rad = error_deg / degrees;
  link.information.setZero();
  link.information.diagonal().head<3>().setConstant(1.0 / (error_m * error_m));
  link.information.diagonal().tail<3>().setConstant(1.0 / (error_rad * error_rad));
  return link;
}

// Earlier nodes close to node `last` in position and orientation, nearest first.
std::vector<std::size_t> closures_of(const Trajectory& truth, std::size_t last,
                                     const LoopClosureOptions& options) {
  const Pose& here = truth[last].world_from_base;
  std::vector<std::pair<double, std::size_t>> found;
  for (std::size_t i = 0; i + static_cast<std::size_t>(options.node_gap) <= last; ++i) {
    const Pose motion = truth[i].world_from_base.inverse() * here;
    const double distance = motion.translation().norm();
    if (distance <= options.distance_m && turn_of(motion) * degrees <= options.angle_deg)
      found.emplace_back(distance, i);
  }
  std::sort(found.begin(), found.end());
  if (found.size() > static_cast<std::size_t>(options.closures_per_node))
    found.resize(static_cast<std::size_t>(options.closures_per_node));
  std::vector<std::size_t> nodes;
  nodes.reserve(found.size());
  for (const auto& [distance, node] : found) nodes.push_back(node);
  return nodes;
}

void add_closures(PoseGraph& graph, const Trajectory& truth, const LoopClosureOptions& options,
                  std::uint64_t seed) {
  for (std::size_t last = 0; last < truth.size(); ++last)
    for (const std::size_t first : closures_of(truth, last, options))
      graph.links.push_back(
          noisy_link(truth[first].node, truth[last].node, LinkType::global_closure,
                     truth[first].world_from_base.inverse() * truth[last].world_from_base,
                     options.shift_error_m, options.turn_error_deg,
                     RandomStream(mix_bits(seed, closure_key), first * truth.size() + last)));
}

// The color camera at the size of depth images.
Camera at_depth_size(const Camera& camera, const CalibrationFaults& faults) {
  RgbdFrame frame;
  frame.cameras = {camera};
  frame.depth = DepthImage(faults.depth_width_px > 0 ? faults.depth_width_px : camera.width,
                           faults.depth_height_px > 0 ? faults.depth_height_px : camera.height);
  return camera_views(frame).front().depth_camera;
}

// Renders the frames of a scan.
class ScanCamera {
 public:
  ScanCamera(const ScanScene& scene, const ScanSimulationOptions& options)
      : options_(options),
        faults_(options.faults.calibration),
        rays_(make_view_rays(options.camera)),
        depth_camera_(at_depth_size(options.camera, faults_)),
        depth_rays_(make_view_rays(depth_camera_)),
        scene_(scene),
        color_from_depth_(color_from_depth(faults_, mix_bits(options.seed, fault_key))) {}

  DepthMeasurement take(std::size_t n, const VisibleSurface& surface, RgbdFrame& frame) const;

  // Camera poses of a frame, and the range of its view.
  std::vector<Pose> world_from_cameras(std::size_t n) const;
  ViewRange range() const;

 private:
  Pose world_from_camera(std::size_t n, double after_s) const {
    return options_.events.seen_pose(scene_.motion(n, after_s), n) *
           options_.camera.base_from_camera;
  }
  bool is_depth_apart() const {
    return has_own_lens() || faults_.depth_shift_mm != 0.0 || faults_.depth_turn_deg != 0.0 ||
           faults_.depth_delay_s != 0.0 || faults_.rolling_shutter_s != 0.0;
  }
  bool has_own_lens() const {
    return faults_.depth_baseline_mm != 0.0 || depth_camera_.width != options_.camera.width ||
           depth_camera_.height != options_.camera.height;
  }
  Pose world_from_depth_camera(std::size_t n) const {
    return world_from_camera(n, faults_.depth_delay_s) * color_from_depth_;
  }
  SurfaceView view(std::size_t n, const VisibleSurface& surface, const ViewRays& rays,
                   const VisibleSurface::PoseOfRow& world_from_camera, bool with_color) const;
  SurfaceView image_view(std::size_t n, const VisibleSurface& surface) const;
  ColorImage photo_of(SurfaceView& view, std::size_t n, std::uint64_t key) const;

  const ScanSimulationOptions& options_;
  const CalibrationFaults& faults_;
  ViewRays rays_;
  Camera depth_camera_;
  ViewRays depth_rays_;
  const ScanScene& scene_;
  Pose color_from_depth_;
};

SurfaceView ScanCamera::view(std::size_t n, const VisibleSurface& surface, const ViewRays& rays,
                             const VisibleSurface::PoseOfRow& world_from_camera,
                             bool with_color) const {
  SurfaceView view = surface.view(rays, world_from_camera, with_color);
  for (const ExtraBody& body : scene_.bodies)
    if (const auto world_from_body = body.world_from_body(n)) {
      const Pose body_from_world = world_from_body->inverse();
      merge_nearer(
          view,
          body.surface->view(
              rays, [&](double row) -> Pose { return body_from_world * world_from_camera(row); },
              with_color));
    }
  return view;
}

std::vector<Pose> ScanCamera::world_from_cameras(std::size_t n) const {
  std::vector<Pose> poses = {world_from_camera(n, 0.0)};
  if (faults_.rolling_shutter_s != 0.0)
    for (const double fraction : {-0.5, 0.5})
      poses.push_back(world_from_camera(n, fraction * faults_.rolling_shutter_s));
  if (is_depth_apart()) poses.push_back(world_from_depth_camera(n));
  return poses;
}

// View of both cameras up to the largest true depth that noise and faults may measure as far_m.
ViewRange ScanCamera::range() const {
  const DepthFaults& faults = options_.faults.depth;
  const double far_m = options_.depth.far_m;
  const double widest =
      1.0 + 0.01 * std::abs(faults.scale_percent) +
      far_deviations * (options_.depth.noise_of_range + options_.depth.noise_of_square * far_m);
  const double seen_m = far_m * widest + far_deviations * options_.depth.noise_m +
                        std::abs(options_.depth.depth_offset_m) +
                        std::abs(faults.periodic_error_m) + std::abs(faults.corner_m);
  ViewRange range = view_range(rays_, seen_m);
  const ViewRange of_depth = view_range(depth_rays_, seen_m);
  range.rays.extend(of_depth.rays);
  return range;
}

SurfaceView ScanCamera::image_view(std::size_t n, const VisibleSurface& surface) const {
  const double row_s = faults_.rolling_shutter_s / std::max(1, rays_.height - 1);
  const Pose middle = world_from_camera(n, 0.0);
  return view(
      n, surface, rays_,
      [&](double row) {
        return row_s == 0.0 ? middle
                            : world_from_camera(n, row_s * (row - 0.5 * (rays_.height - 1)));
      },
      true);
}

ColorImage ScanCamera::photo_of(SurfaceView& view, std::size_t n, std::uint64_t key) const {
  const PhotoFaults& faults = options_.faults.photo;
  if (is_blurred(faults, mix_bits(options_.seed, key + 3)))
    blur_by_motion(
        view, options_.camera,
        [&](double time_s) {
          return world_from_camera(n, 0.0).inverse() * world_from_camera(n, time_s);
        },
        faults.exposure_s);
  change_exposure(view, faults, mix_bits(options_.seed, fault_key), n);
  return compress_photo(take_photo(view, options_.photo, mix_bits(options_.seed, key + 1)), faults);
}

DepthMeasurement ScanCamera::take(std::size_t n, const VisibleSurface& surface,
                                  RgbdFrame& frame) const {
  const auto key = frame_key + 4 * static_cast<std::uint64_t>(n);
  SurfaceView view = image_view(n, surface);
  frame.cameras = {stored_camera(options_.camera, faults_)};
  frame.color = photo_of(view, n, key);
  const Pose world_from_depth = world_from_depth_camera(n);
  if (is_depth_apart())
    view = this->view(
        n, surface, depth_rays_, [&](double) { return world_from_depth; }, false);
  add_multipath(view, surface, depth_rays_, world_from_depth, options_.faults.depth.multipath);
  distort_depth(view, options_.faults.depth);
  DepthSensorOptions sensor = options_.depth;
  sensor.far_m = options_.events.far_at(n, sensor.far_m);
  DepthMeasurement measured =
      measure_depth(view, depth_rays_, sensor, mix_bits(options_.seed, key));
  measured.measured -=
      punch_holes(measured.depth, options_.faults.depth, mix_bits(options_.seed, key + 2));
  if (faults_.depth_baseline_mm != 0.0)
    measured.depth =
        register_depth(measured.depth, depth_camera_, at_depth_size(frame.cameras.front(), faults_),
                       stored_color_from_depth(faults_));
  return measured;
}

}  // namespace

void bind(ParameterTable& table, OdometryOptions& options) {
  table.add(
      "odometry_error_of_distance", options.error_of_distance, not_negative,
      "standard deviation of the error of an odometry step along each axis, m per m of distance");
  table.add("odometry_error_of_turn", options.error_of_turn, not_negative,
            "standard deviation of the error of an odometry step about each axis: term "
            "proportional to the rotation, degrees per degree");
  table.add("odometry_turn_of_distance_deg", options.turn_of_distance_deg, not_negative,
            "standard deviation of the error of an odometry step about each axis: term "
            "proportional to the distance, degrees per m");
}

void bind(ParameterTable& table, LoopClosureOptions& options) {
  table.add("closures", options.closures, "add loop closures between nodes with similar poses");
  table.add("closure_distance_m", options.distance_m, not_negative,
            "maximum distance between the two poses of a loop closure, m");
  table.add("closure_angle_deg", options.angle_deg, {0.0, 180.0},
            "maximum angle between the two poses of a loop closure, degrees");
  table.add("closure_node_gap", options.node_gap, {2.0, 1e6},
            "minimum difference between the indices of the two nodes of a loop closure");
  table.add("closures_per_node", options.closures_per_node, {1.0, 1e6},
            "maximum number of loop closures from each node to the nearest earlier nodes");
  table.add("closure_shift_error_m", options.shift_error_m, positive,
            "standard deviation of the error of a loop closure along each axis, m");
  table.add("closure_turn_error_deg", options.turn_error_deg, positive,
            "standard deviation of the error of a loop closure about each axis, degrees");
}

PoseGraph simulate_odometry(const Trajectory& truth, const OdometryOptions& odometry,
                            const LoopClosureOptions& closures, std::uint64_t seed) {
  PoseGraph graph;
  Pose odometry_from_base = Pose::Identity();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (i > 0) {
      const Pose motion = truth[i - 1].world_from_base.inverse() * truth[i].world_from_base;
      const double way_m = motion.translation().norm();
      const double error_m = std::max(min_odometry_error_m, odometry.error_of_distance * way_m);
      const double error_deg =
          std::max(min_odometry_error_deg, odometry.error_of_turn * turn_of(motion) * degrees +
                                               odometry.turn_of_distance_deg * way_m);
      graph.links.push_back(noisy_link(truth[i - 1].node, truth[i].node, LinkType::neighbor, motion,
                                       error_m, error_deg,
                                       RandomStream(mix_bits(seed, odometry_key), i)));
      odometry_from_base = odometry_from_base * graph.links.back().from_from_to;
    }
    GraphNode node{.id = truth[i].node, .stamp_s = truth[i].stamp_s};
    node.odometry_from_base = odometry_from_base;
    node.truth_from_base = truth[i].world_from_base;
    graph.nodes.push_back(node);
  }
  if (closures.closures) add_closures(graph, truth, closures, seed);
  return graph;
}

Camera kinect_v2_camera() {
  return {.width = 512, .height = 424, .fx = 365.0, .fy = 365.0, .cx = 256.0, .cy = 212.0};
}

ScanScene scene_of(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                   const Trajectory& poses) {
  const std::uint64_t seed = mix_bits(options.seed, trajectory_key);
  ScanScene scene;
  scene.surfaces = [surface = VisibleSurface(mesh, options.texture, options.texture_seed())](
                       const std::vector<std::vector<Pose>>& frames, const ViewRange&) {
    return std::vector<VisibleSurface>(frames.size(), surface);
  };
  if (!poses.empty()) {
    scene.motion = motion_through(poses);
  } else if (options.trajectory.path == CameraPath::serpentine) {
    GroundHeights ground;
    ground.add(mesh.vertices);
    scene.motion = serpentine_motion(ground, options.trajectory, seed);
  } else {
    scene.motion = camera_motion(mesh, options.trajectory, seed);
  }
  scene.bodies = extra_bodies(mesh, options.events, options.seed);
  scene.truth = poses.empty() ? poses_of_motion(scene.motion, options.trajectory) : poses;
  return scene;
}

ScanScene scene_of(TerrainSurface& terrain, const GroundHeights& ground,
                   const ScanSimulationOptions& options, const Trajectory& poses) {
  ScanScene scene;
  scene.surfaces = [&](const std::vector<std::vector<Pose>>& frames, const ViewRange& range) {
    return terrain.seen_from(frames, range);
  };
  scene.motion = poses.empty() ? serpentine_motion(ground, options.trajectory,
                                                   mix_bits(options.seed, trajectory_key))
                               : motion_through(poses);
  scene.truth = poses.empty() ? poses_of_motion(scene.motion, options.trajectory) : poses;
  return scene;
}

ScanSimulationResult simulate_scan(const ScanScene& scene, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress) {
  const ScanCamera camera(scene, options);
  const std::vector<RecordedFrame> recorded = recorded_frames(
      scene.truth.size(), options.faults.recording, mix_bits(options.seed, recording_key));
  Trajectory truth;
  for (const RecordedFrame& one : recorded) {
    TrajectoryPose pose = scene.truth[one.frame];
    pose.stamp_s += one.stamp_error_s;
    pose.world_from_base = options.events.seen_pose(pose.world_from_base, one.frame);
    truth.push_back(pose);
  }
  ScanSimulationResult result;
  result.graph = simulate_odometry(truth, options.odometry, options.closures, options.seed);
  result.path_length_m = path_length(truth);
  progress.begin("frames", truth.size());
  for (std::size_t first = 0; first < truth.size(); first += batch) {
    const std::size_t count = std::min(batch, truth.size() - first);
    std::vector<std::vector<Pose>> poses;
    for (std::size_t i = 0; i < count; ++i)
      poses.push_back(camera.world_from_cameras(recorded[first + i].image_frame));
    const std::vector<VisibleSurface> surfaces = scene.surfaces(poses, camera.range());
    std::array<RgbdFrame, batch> frames;
    std::array<DepthMeasurement, batch> measured;
    parallel_each(count, [&](std::size_t i) {
      frames[i].node = truth[first + i].node;
      frames[i].stamp_s = truth[first + i].stamp_s;
      measured[i] = camera.take(recorded[first + i].image_frame, surfaces[i], frames[i]);
      frames[i].depth = std::move(measured[i].depth);
    });
    for (std::size_t i = 0; i < count; ++i) {
      result.pixels += frames[i].depth.pixels.size();
      result.measured_pixels += measured[i].measured;
      result.edge_pixels += measured[i].edges;
      result.flying_pixels += measured[i].flying;
      result.empty_frames += measured[i].measured == 0;
      sink(result.graph.nodes[first + i], frames[i]);
      progress.advance(1);
    }
  }
  progress.end();
  if (result.measured_pixels == 0)
    throw Error("none sees the mesh within the depth range; check poses, near_m and far_m",
                {.field = "frames"});
  return result;
}

ScanSimulationResult simulate_scan(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress) {
  return simulate_scan(scene_of(mesh, options), options, sink, progress);
}

}  // namespace libmap
