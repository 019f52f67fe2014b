// Main entry of the detection ("Graspable Target Detection for Hexapod Robots", 2023, chapters 2.5
// and 3.2): computes a graspability map from a point cloud in memory. The map contains a score for
// each occupied voxel of the terrain as a target of a spined gripper.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper.h"
#include "libgtd/score/graspability_map.h"
#include "libgtd/score/scenario.h"
#include "libgtd/terrain/regression_plane.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/stage_timer.h"

namespace libgtd {

// Source of the terrain frame. fit: downsamples the cloud (methods thesis and envelope only), fits
// the regression plane and transforms the cloud into the plane's frame. none: the cloud's frame.
enum class PlaneSource { fit, none };

struct DetectionOptions {
  Scenario scenario;
  std::optional<Gripper> gripper;  // default: the gripper named by the scenario
  PlaneSource plane = PlaneSource::fit;
  std::optional<Eigen::Vector3d> up;  // out of ground, cloud's frame; nullopt: estimated (UpSource)
  double max_tilt_deg = 90.0;         // maximum angle between `up` and the plane's normal
};
// Binds the keys of the scenario and `plane`, but not `up` and `max_tilt_deg`.
void bind(libmap::ParameterTable& table, DetectionOptions& options);

struct DetectionResult {
  GraspabilityMap map;
  GripperMask mask;
  std::optional<RegressionPlane> plane;  // nullopt with PlaneSource::none
  std::size_t points = 0;                // points of the input cloud
  std::size_t downsampled_points = 0;    // points after downsampling; 0: not downsampled
  std::size_t interpolated_points = 0;   // nodes of the interpolation grid; 0: not interpolated
  double grid_spacing_m = 0.0;           // spacing of this grid; 0: not interpolated
  std::size_t occupied_voxels = 0;
  std::size_t isolated_voxels = 0;  // occupied voxels of which all 26 neighbors are empty
  Voxel grid_min;                   // corners of the bounding box of the occupied voxels
  Voxel grid_max;
  std::size_t tiles = 0;             // tiles that cover the grid
  std::size_t curvature_points = 0;  // points at which the curvature was estimated
  std::size_t convex_points = 0;     // curvature points that are convex
  std::size_t graspable_voxels = 0;
  std::size_t border_voxels = 0;          // the mask window extends beyond the scanned area
  std::size_t unoriented_voxels = 0;      // orientation surface: no normal, so upright mask
  std::size_t obstacle_voxels = 0;        // obstacles and unreachable voxels
  std::optional<double> normal_radius_m;  // nullopt if no surface normals were fitted
  libmap::StageTimings timings_s;         // wall time of each step
};
// Names each result for manifests and tables (libmap/core/result_table.h).
void describe(libmap::ResultTable& table, const DetectionResult& result);

// Returns options.gripper, or else the scenario's gripper with its overrides. Throws like
// find_gripper (gripper_io.h).
Gripper gripper_of(const DetectionOptions& options);

// Detects graspable targets in `terrain` (m, any frame); the frame of the result is the terrain
// frame. Throws Error for an empty cloud, options out of range, points too sparse for the voxel
// size (methods corrected and calibrated; voxel_grid.h), and all errors of the individual stages.
DetectionResult detect(const libmap::PointCloud& terrain, const DetectionOptions& options,
                       libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
