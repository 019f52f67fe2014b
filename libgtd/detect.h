// The whole detection of graspable targets: terrain in, graspability map out ("Graspable Target
// Detection for Hexapod Robots", 2023, chapters 2.5 and 3.2).
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
#include "libmap/tiles/tile_share.h"

namespace libgtd {

// fit: thin the cloud (`thesis` alone), fit the regression plane and carry the cloud into its
// frame. none: the cloud is already in the terrain frame and taken as it is.
enum class PlaneSource { fit, none };

struct DetectionOptions {
  Scenario scenario;
  std::optional<Gripper> gripper;  // default: the one that the scenario names
  PlaneSource plane = PlaneSource::fit;
  std::optional<Eigen::Vector3d> up;  // in the cloud's frame: which side of the plane is outside
  double max_tilt_deg = 90.0;         // between `up` and the plane's normal
  libmap::TileShare share;            // score only these tiles
};
// The keys of the scenario, and `plane`.
void bind(libmap::ParameterTable& table, DetectionOptions& options);

struct DetectionResult {
  GraspabilityMap map;
  GripperMask mask;
  std::optional<RegressionPlane> plane;
  std::size_t points = 0;              // of the input
  std::size_t downsampled_points = 0;  // after downsampling, which only `thesis` does
  std::size_t interpolated_points = 0;
  double grid_spacing_m = 0.0;  // of the interpolation
  std::size_t occupied_voxels = 0;
  std::size_t lone_voxels = 0;  // without an occupied one among their 26 neighbors
  Voxel grid_min;
  Voxel grid_max;
  std::size_t tiles = 0;             // that were scored
  std::size_t curvature_points = 0;  // whose curvature was measured
  std::size_t convex_points = 0;
  std::size_t graspable_voxels = 0;
  std::size_t border_voxels = 0;
  std::size_t unoriented_voxels = 0;  // orientation surface: without a normal, so evaluated upright
  std::size_t obstacle_voxels = 0;    // of the whole map alone, not of a share
  std::optional<double> normal_radius_m;  // of the surface, if normals were fitted
  libmap::StageTimings timings_s;         // wall time of each step
};
// Names the results of a detection (libmap/core/result_table.h).
void describe(libmap::ResultTable& table, const DetectionResult& result);

// The gripper of `options`: its own, else the scenario's with its overrides. Throws as
// find_gripper.
Gripper gripper_of(const DetectionOptions& options);

// Throws Error for an empty cloud, options out of their bounds, points too far apart for the voxels
// (voxel_grid.h), and what the steps throw.
DetectionResult detect(const libmap::PointCloud& terrain, const DetectionOptions& options,
                       libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
