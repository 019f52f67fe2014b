// Scores tiles of a terrain, for detect() and detect_streamed(): computes the voxels of the map
// from points in the terrain frame and a voxel grid. Only data in a tile and in a margin around the
// tile (the halo) affect the result of the tile.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libgtd/score/scenario.h"
#include "libgtd/shape/curvature.h"
#include "libgtd/terrain/regression_plane.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/stage_timer.h"

namespace libgtd {

// Returns true for thesis and envelope, which prepare the cloud as the thesis does.
bool follows_thesis(Method method);

// Returns the plane fit of a method: PlaneMethod::thesis for thesis and envelope, corrected for
// climblab (least squares, as in the source of ClimbLab), robust for the other methods.
PlaneMethod plane_method(Method method);

// Returns the width of a tile in voxels. Throws Error naming tile_size_m if it is out of range.
int tile_voxels(const Scenario& scenario);

// Returns the width of the halo in voxels: the distance around a tile within which voxels and
// points affect the tile's scores, border marks, convexity and normals. Interpolation and obstacles
// depend on the whole terrain. Throws Error naming a radius that is too large for the voxel size.
int halo_voxels(const GripperMask& mask, const Scenario& scenario);

// Returns the radius of the surface normal fits of a scenario, m.
double normal_radius_m(const GripperMask& mask, const Scenario& scenario);

// Returns the optional fields of the map that a scenario computes, except obstacles.
MapContent content_of(const Scenario& scenario);

// Options for the curvature near scored voxels and the convexity test.
struct ConvexityStage {
  CurvatureOptions curvature;
  bool average_per_voxel = true;  // one mean point per voxel is used: density has no effect
  double zero_plane_m = 0.0;      // CurvatureMethod::thesis only: minimum height of convex points
  double distance_m = 0.01;       // maximum distance from a convex voxel to a convex point
};

// Conditions for a scored voxel to be graspable.
struct GraspableRule {
  Method method = Method::calibrated;
  int solid_voxel_threshold = 120;  // TSV in score_percent, meets_threshold (voxel_matching.h)
  double score_threshold = 0.8;     // minimum score; not used by Method::climblab
  double zero_plane_m = 0.0;        // minimum height of the voxel's center, terrain frame
  bool needs_convexity = false;     // the voxel must be near a convex point
};

// Options of detect_tiles; tile_detection_options derives them from a scenario.
struct TileDetectionOptions {
  bool tilts_mask = false;                  // mask axis along the surface normal
  std::optional<double> normal_radius_m;    // radius of normal fits; nullopt: no fits
  std::optional<ConvexityStage> convexity;  // nullopt: not evaluated
  GraspableRule graspable;
};
TileDetectionOptions tile_detection_options(const GripperMask& mask, const Scenario& scenario);

// Data of the terrain, at least inside the tiles and the halo, in the terrain frame.
struct TileSurroundings {
  const libmap::PointCloud& terrain;  // measured points, for the curvature
  const libmap::PointCloud& surface;  // points from which the voxels were made
  const VoxelGrid& grid;              // its box (min, max) is that of the whole terrain
};

struct TileDetectionResult {
  std::vector<MapVoxel> voxels;       // ascending
  std::size_t unoriented_voxels = 0;  // tilted masks only: no normal, upright mask used
  std::size_t curvature_points = 0;   // points at which the curvature was estimated
  std::size_t convex_points = 0;
  libmap::StageTimings timings_s;  // wall time of each step
};

// Points at which curvature is estimated. points_near_tiles: only points that can make a voxel of
// the tiles convex, with the same voxels as result, but fewer curvature_points and convex_points.
enum class CurvatureExtent { points_near_tiles, all_points };

// Scores the voxels of the tiles. Throws all errors of the individual stages.
TileDetectionResult detect_tiles(const TileSurroundings& surroundings, const GripperMask& mask,
                                 const std::vector<TileBounds>& tiles, CurvatureExtent curvature_at,
                                 const TileDetectionOptions& options,
                                 libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
