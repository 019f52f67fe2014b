// Simulates trajectories of a hand-held camera: around a site, over ground, or along given poses.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "libmap/core/parameters.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/ground_heights.h"

namespace libmap {

// Path of the camera. automatic: loops around a mesh, a serpentine over terrain (a cloud).
enum class CameraPath { automatic, loops, serpentine };

// Serpentine: parallel lanes along the longer side of the ground, in alternating direction and
// joined by half circles. The camera looks at the ground ahead.
struct SerpentineOptions {
  double lane_m = 1.5;    // maximum distance between lanes
  double border_m = 0.5;  // distance between the path and the border of the ground
  double ahead_m = 1.5;   // distance along the path to the ground point that the camera looks at
};
void bind(ParameterTable& table, SerpentineOptions& options);

// Loops about the vertical axis through the center of the mesh. If a loop is not a full circle,
// every second loop runs backwards. Radius and height change smoothly between loops. In front of a
// wall (a surface that mostly faces horizontally), loops are arcs.
struct CameraTrajectoryOptions {
  CameraPath path = CameraPath::automatic;
  SerpentineOptions serpentine{};
  int frames = 60;             // number of poses
  int loops = 2;               // number of loops
  double radius_m = 0.0;       // radius of the first loop; 0: 2/3 of the mesh's smaller horizontal
                               // side (wall: larger side), limited to 0.8 to 2 m
  double last_radius_m = 0.0;  // radius of the last loop; 0: 0.7 times the radius of the first loop
  double height_m = 0.0;       // height above the ground on the first loop; 0: 0.6 times its radius
                               // serpentine: height above the local mean ground; 0: 1.4 m
  double last_height_m = 0.0;  // height on the last loop; 0: 0.8 times the radius of the first loop
  double start_deg = 0.0;      // direction of the first loop's start, counter-clockwise from x;
                               // wall: relative to the default start
  double sweep_deg = 0.0;      // angle of each loop; negative: clockwise; 0: 360, at a wall 120
  std::optional<Eigen::Vector3d> target;  // point that the camera looks at; default: the ground at
                                          // the center of the site, or the center of the wall
  double gaze_deg = 8.0;                  // standard deviation of the angle between view and target
  double sway_m = 0.01;           // standard deviation of the position from the path, per axis
  double tremor_deg = 1.0;        // standard deviation of the camera's rotation about each axis
  double frame_interval_s = 1.0;  // time between two poses
};
// Binds all fields except the target.
void bind(ParameterTable& table, CameraTrajectoryOptions& options);

// Returns the height of the ground around a site: the median z of the vertices in the outer tenths
// of the mesh's range of x or of y. Throws Error for a mesh without vertices.
double surrounding_ground_height(const TriangleMesh& mesh);

// Function that returns the pose of the camera's body (x forward, y left, z up) in the mesh's
// frame, `after_s` seconds after the stamp of frame `frame` (from 0).
using CameraMotion = std::function<Pose(std::size_t frame, double after_s)>;
// Returns the motion on loops around a mesh. Throws Error for a mesh without vertices.
CameraMotion camera_motion(const TriangleMesh& mesh, const CameraTrajectoryOptions& options,
                           std::uint64_t seed);
// Returns the motion on a serpentine over the ground. Throws Error if `ground` is empty.
CameraMotion serpentine_motion(const GroundHeights& ground, const CameraTrajectoryOptions& options,
                               std::uint64_t seed);
// Returns the motion through given poses, with constant velocities between successive stamps.
CameraMotion motion_through(Trajectory poses);

// Returns the poses of a motion at all frames. Nodes begin at 1, stamps at 1,700,000,000 s.
Trajectory poses_of_motion(const CameraMotion& motion, const CameraTrajectoryOptions& options);
// Numbers the poses from 1, and stamps them as poses_of_motion does if all stamps are 0. Throws
// Error if stamps do not strictly ascend.
Trajectory assign_nodes_and_stamps(Trajectory poses, double frame_interval_s);

}  // namespace libmap
