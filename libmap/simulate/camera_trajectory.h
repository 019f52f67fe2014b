// The way of a camera that is carried by hand around a site or over ground, or along given poses.
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

// automatic: loops around a mesh, a serpentine over ground of any size.
enum class CameraPath { automatic, loops, serpentine };

// Lanes to and fro over the ground, along its longer side, joined by half circles; the look is
// towards the ground further along the way.
struct SerpentineOptions {
  double lane_m = 1.5;    // between lanes, at most
  double border_m = 0.5;  // between the way and the border of the ground
  double ahead_m = 1.5;   // what is looked at
};
void bind(ParameterTable& table, SerpentineOptions& options);

// Loops about the vertical through the middle of the mesh. Where the sweep is less than a full
// circle, every other loop goes back. Radius and height change from loop to loop, smoothly, around
// the loop's end. Before a wall (a surface that mostly faces a level direction) loops are arcs.
struct CameraTrajectoryOptions {
  CameraPath path = CameraPath::automatic;
  SerpentineOptions serpentine{};
  int frames = 60;
  int loops = 2;
  double radius_m = 0.0;       // of the first loop; 0: 4/3 of half the mesh's smaller side (of a
                               // wall: its length), 0.8 to 2 m
  double last_radius_m = 0.0;  // of the last loop; 0: 0.7 times the first
  double height_m = 0.0;       // above the ground on the first loop; 0: 0.6 times its radius; of a
                               // serpentine: above the mean ground, 0: 1.4 m
  double last_height_m = 0.0;  // on the last loop; 0: 0.8 times the first radius
  double start_deg = 0.0;      // where the first loop begins, counter-clockwise from x; of a wall:
                               // from where it begins by itself
  double sweep_deg = 0.0;      // of each loop; negative: clockwise; 0: 360, or 120 before a wall
  std::optional<Eigen::Vector3d> target;  // what is looked at; nothing: the ground in the middle of
                                          // the site, or the middle of the wall
  double gaze_deg = 8.0;                  // how far the look wanders from the target
  double sway_m = 0.01;           // standard deviation of the hand about its way, in each axis
  double tremor_deg = 1.0;        // and of its turns about each axis
  double frame_interval_s = 1.0;  // between two poses
};
// All but the target.
void bind(ParameterTable& table, CameraTrajectoryOptions& options);

// Height of the ground around a site: median height of the vertices in the outer tenth of the
// mesh's length and width.
double surrounding_ground_height(const TriangleMesh& mesh);

// Pose of the camera's body (x forward, y left, z up) in the mesh's frame, a time after that of the
// frame, which counts from 0. Throws Error for a mesh without vertices.
using CameraMotion = std::function<Pose(std::size_t frame, double after_s)>;
CameraMotion camera_motion(const TriangleMesh& mesh, const CameraTrajectoryOptions& options,
                           std::uint64_t seed);

// The same of a serpentine over the ground. Throws Error without points.
CameraMotion serpentine_motion(const GroundHeights& ground, const CameraTrajectoryOptions& options,
                               std::uint64_t seed);
// Through the poses at their stamps, between them at constant speed and turn.
CameraMotion motion_through(Trajectory poses);

// Poses at the frames; nodes from 1. Stamps begin at 1,700,000,000 s. The hand's motions are smooth
// in time; the same seed gives the same.
Trajectory poses_of_motion(const CameraMotion& motion, const CameraTrajectoryOptions& options);
// Numbers the poses from 1 on, and stamps them as poses_of_motion does if no pose has a stamp.
// Throws Error where a stamp is not later than the one before.
Trajectory numbered(Trajectory poses, double frame_interval_s);

}  // namespace libmap
