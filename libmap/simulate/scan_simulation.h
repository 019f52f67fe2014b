// Simulates a hand-held RGB-D scan of a mesh: images, drifting odometry, links and ground truth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/camera_trajectory.h"
#include "libmap/simulate/depth_camera.h"
#include "libmap/simulate/scan_events.h"
#include "libmap/simulate/sensor_faults.h"
#include "libmap/simulate/terrain_surface.h"

namespace libmap {

// A measured motion is the true one followed by a small error: from_from_to = true motion *
// make_pose_from_rpy(e), e = x y z roll pitch yaw drawn from normal distributions. Links carry the
// inverse of the covariance from which e was drawn.
struct OdometryOptions {
  double error_of_distance = 0.01;  // standard deviation in each axis, m per m of distance
  double error_of_turn = 0.005;  // standard deviation about each axis, degrees per degree of turn
  double turn_of_distance_deg = 0.2;  // about each axis, added to the former; degrees per m
};
// Minimum standard deviations, for short motions.
inline constexpr double min_odometry_error_m = 2e-4;
inline constexpr double min_odometry_error_deg = 0.01;
void bind(ParameterTable& table, OdometryOptions& options);

struct LoopClosureOptions {
  bool closures = false;         // true: add loop closures
  double distance_m = 0.8;       // maximum distance between the two poses
  double angle_deg = 40.0;       // maximum angle between the two poses
  int node_gap = 10;             // minimum difference of node indices
  int closures_per_node = 2;     // maximum number to earlier nodes, nearest first
  double shift_error_m = 0.005;  // standard deviation of the error in each axis
  double turn_error_deg = 0.2;   // standard deviation of the error about each axis
};
void bind(ParameterTable& table, LoopClosureOptions& options);

// Simulates odometry from true poses. Returns nodes with true and odometry poses (the first
// odometry pose is the identity), neighbor links, and loop closures if enabled.
PoseGraph simulate_odometry(const Trajectory& truth, const OdometryOptions& odometry,
                            const LoopClosureOptions& closures, std::uint64_t seed);

// The Kinect v2's infrared camera: 512 x 424 pixels, 70 x 60 degrees.
Camera kinect_v2_camera();

struct ScanSimulationOptions {
  Camera camera = kinect_v2_camera();
  TextureSource texture = TextureSource::automatic;
  CameraTrajectoryOptions trajectory{};
  DepthSensorOptions depth{};
  PhotoOptions photo{};
  SensorFaults faults{};
  ScanEvents events{};
  OdometryOptions odometry{};
  LoopClosureOptions closures{};
  std::uint64_t seed = 1;       // random seed of path, errors and colors
  std::uint64_t rock_seed = 0;  // seed of rock colors, equal for scans of one ground; 0: `seed`
  std::uint64_t texture_seed() const { return rock_seed == 0 ? seed : rock_seed; }
};

struct ScanSimulationResult {
  PoseGraph graph;                  // nodes as passed to the sink, and links
  std::size_t pixels = 0;           // depth pixels of all frames
  std::size_t measured_pixels = 0;  // pixels with a depth
  std::size_t edge_pixels = 0;      // as DepthMeasurement::edges
  std::size_t flying_pixels = 0;    // as DepthMeasurement::flying
  std::size_t empty_frames = 0;     // frames without any depth
  double path_length_m = 0.0;
};

// Scanned surface and camera motion.
struct ScanScene {
  // Returns the surface visible in each of several frames, given the camera poses of each frame.
  using Surfaces = std::function<std::vector<VisibleSurface>(
      const std::vector<std::vector<Pose>>& world_from_camera, const ViewRange& range)>;
  Surfaces surfaces;
  CameraMotion motion;
  std::vector<ExtraBody> bodies;  // objects of the options' events; none for terrain
  Trajectory truth;               // poses at the frames, as of assign_nodes_and_stamps()
};
// Scene of a mesh, or of terrain, which must outlive the scene. The camera follows `poses`, or the
// path of the options if `poses` is empty.
ScanScene scene_of(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                   const Trajectory& poses = {});
ScanScene scene_of(TerrainSurface& terrain, const GroundHeights& ground,
                   const ScanSimulationOptions& options, const Trajectory& poses = {});

// Renders all frames and passes them to `sink` in the order of nodes; at most 8 frames are in
// memory. Ground truth poses are poses of the camera's body in the mesh's frame at the time of the
// middle image row. Throws Error if no frame has any depth.
using FrameSink = std::function<void(const GraphNode& node, const RgbdFrame& frame)>;
ScanSimulationResult simulate_scan(const ScanScene& scene, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());
// Simulates a scan of `mesh` along the options' path. Also throws Error if the mesh has no
// triangle.
ScanSimulationResult simulate_scan(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());

}  // namespace libmap
