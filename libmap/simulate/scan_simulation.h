// A scan of a mesh as an RGB-D camera carried by hand records it: images, odometry that drifts,
// links, and the truth.
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
  double error_of_distance = 0.01;  // standard deviation in each axis, m a m of way
  double error_of_turn = 0.005;     // standard deviation about each axis, degrees a degree of turn
  double turn_of_distance_deg = 0.2;  // ... and degrees a m of way
};
// So much at least, however short the motion.
inline constexpr double min_odometry_error_m = 2e-4;
inline constexpr double min_odometry_error_deg = 0.01;
void bind(ParameterTable& table, OdometryOptions& options);

struct LoopClosureOptions {
  bool closures = false;
  double distance_m = 0.8;       // between the two places, at most
  double angle_deg = 40.0;       // between the two views, at most
  int node_gap = 10;             // nodes between the two in time, at least
  int closures_per_node = 2;     // to earlier nodes, the nearest first
  double shift_error_m = 0.005;  // standard deviation in each axis
  double turn_error_deg = 0.2;   // standard deviation about each axis
};
void bind(ParameterTable& table, LoopClosureOptions& options);

// Odometry from the true poses: nodes with both poses, the first odometry pose being the identity,
// and neighbor links; then closures where they are wanted.
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
  std::uint64_t seed = 1;
  std::uint64_t rock_seed =
      0;  // of the rock's colors; 0: `seed`. Scans of the same ground share it
  std::uint64_t texture_seed() const { return rock_seed == 0 ? seed : rock_seed; }
};

struct ScanSimulationResult {
  PoseGraph graph;                  // as given to the sink, with its links
  std::size_t pixels = 0;           // of all frames
  std::size_t measured_pixels = 0;  // with a depth
  std::size_t edge_pixels = 0;
  std::size_t flying_pixels = 0;
  std::size_t empty_frames = 0;  // without any depth
  double path_length_m = 0.0;
};

// What is scanned, and the way of the camera.
struct ScanScene {
  // What each of a few frames can see, by the poses of its cameras.
  using Surfaces = std::function<std::vector<VisibleSurface>(
      const std::vector<std::vector<Pose>>& world_from_camera, const ViewRange& range)>;
  Surfaces surfaces;
  CameraMotion motion;
  std::vector<ExtraBody> bodies;  // of the options' events; of a terrain none
  Trajectory truth;               // at the frames, as numbered() gives it
};
// The scene of a mesh, and of terrain that outlives it; `poses`: given ones, empty: the options'
// path.
ScanScene scene_of(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                   const Trajectory& poses = {});
ScanScene scene_of(TerrainSurface& terrain, const GroundHeights& ground,
                   const ScanSimulationOptions& options, const Trajectory& poses = {});

// Frames go to `sink` one by one in the order of their nodes; a few are in memory at a time. Ground
// truth poses are those of the camera's body in the mesh's frame when the middle row of the picture
// is taken. Throws Error where the mesh has no
// triangle, or where no frame has any depth.
using FrameSink = std::function<void(const GraphNode& node, const RgbdFrame& frame)>;
ScanSimulationResult simulate_scan(const ScanScene& scene, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());
// Around the mesh, or over it where the options say so.
ScanSimulationResult simulate_scan(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());

}  // namespace libmap
