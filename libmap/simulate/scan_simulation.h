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

// A measured motion is the true motion followed by a small error: measured = true *
// make_pose_from_rpy(e), where e (x y z roll pitch yaw) is drawn from normal distributions. Links
// contain the inverse of the covariance of e.
struct OdometryOptions {
  double error_of_distance = 0.01;  // standard deviation in each axis, m per m of distance
  double error_of_turn = 0.005;  // standard deviation about each axis, degrees per degree of turn
  double turn_of_distance_deg = 0.2;  // more deviation about each axis, degrees per m of distance
};
// Minimum standard deviations of an odometry step in and about each axis.
inline constexpr double min_odometry_error_m = 2e-4;
inline constexpr double min_odometry_error_deg = 0.01;
void bind(ParameterTable& table, OdometryOptions& options);

struct LoopClosureOptions {
  bool closures = false;         // true: loop closures are added
  double distance_m = 0.8;       // maximum distance between the two poses of a loop closure
  double angle_deg = 40.0;       // maximum angle between the two poses
  int node_gap = 10;             // minimum difference between the indices of the two nodes
  int closures_per_node = 2;     // maximum number of closures to earlier nodes, nearest first
  double shift_error_m = 0.005;  // standard deviation of the error in each axis
  double turn_error_deg = 0.2;   // standard deviation of the error about each axis
};
void bind(ParameterTable& table, LoopClosureOptions& options);

// Simulates odometry along true poses. Returns nodes with true poses and odometry (which begins at
// the identity), links between neighbors, and loop closures if enabled.
PoseGraph simulate_odometry(const Trajectory& truth, const OdometryOptions& odometry,
                            const LoopClosureOptions& closures, std::uint64_t seed);

// Returns the infrared camera of the Kinect v2: 512 x 424 pixels, 70 x 60 degrees.
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
  std::uint64_t rock_seed = 0;  // seed of rock colors, equal in all scans of a ground; 0: `seed`
  std::uint64_t texture_seed() const { return rock_seed == 0 ? seed : rock_seed; }
};

struct ScanSimulationResult {
  PoseGraph graph;                  // nodes as passed to the sink, and links
  std::size_t pixels = 0;           // number of depth pixels of all frames
  std::size_t measured_pixels = 0;  // number of depth pixels with a measurement
  std::size_t edge_pixels = 0;      // sum of DepthMeasurement::edges
  std::size_t flying_pixels = 0;    // sum of DepthMeasurement::flying
  std::size_t empty_frames = 0;     // number of frames without any depth
  double path_length_m = 0.0;       // length of the camera's true path
};

// A surface to scan, and the motion of the camera.
struct ScanScene {
  // Returns the surface visible in each of several frames, given all camera poses of each frame.
  using Surfaces = std::function<std::vector<VisibleSurface>(
      const std::vector<std::vector<Pose>>& world_from_camera, const ViewRange& range)>;
  Surfaces surfaces;
  CameraMotion motion;            // pose of the camera's body at any time
  std::vector<ExtraBody> bodies;  // objects of the options' events; none for terrain
  Trajectory truth;               // poses at the frames, from assign_nodes_and_stamps
};
// Returns the scene of a mesh or of a terrain; a terrain must outlive the scene. The camera moves
// along `poses`, or along the path of the options if `poses` is empty.
ScanScene scene_of(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                   const Trajectory& poses = {});
ScanScene scene_of(TerrainSurface& terrain, const GroundHeights& ground,
                   const ScanSimulationOptions& options, const Trajectory& poses = {});

// Renders all frames and passes them to `sink` in the order of nodes; at most 8 frames are in
// memory. Ground truth is the pose of the camera's body in the mesh's frame when the middle image
// row is taken. Throws Error if no frame has any depth.
using FrameSink = std::function<void(const GraphNode& node, const RgbdFrame& frame)>;
ScanSimulationResult simulate_scan(const ScanScene& scene, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());
// Simulates a scan of `mesh` along the options' path. Also throws Error if it has no triangle.
ScanSimulationResult simulate_scan(const TriangleMesh& mesh, const ScanSimulationOptions& options,
                                   const FrameSink& sink, Progress& progress = no_progress());

}  // namespace libmap
