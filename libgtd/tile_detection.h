// The part of a detection that is done tile by tile: from points in the terrain frame and their
// voxels to the map's voxels. A tile needs what lies in it and in a halo around it, no more, and
// yields the same to the bit whatever else is there.
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

// Whether a method prepares the cloud as the author's program does (`thesis`, `envelope`).
bool follows_thesis(Method method);

// `climblab` has the least-squares plane of its source, the others of ours the robust one.
PlaneMethod plane_method(Method method);

// Width of a tile. Throws Error naming tile_size_m.
int tile_voxels(const Scenario& scenario);

// How many columns around a tile its voxels depend on: the mask's window, the closing of the
// scanned area, the points that decide on convexity with all their neighbors, and those on the
// surface's normal. Not of interpolation or obstacles, which look at the whole terrain.
int halo_voxels(const GripperMask& mask, const Scenario& scenario);

// Radius of the surface's normals that the scenario asks for.
double normal_radius_m(const GripperMask& mask, const Scenario& scenario);

// What a detection with these parameters says beside its scores, but for obstacles.
MapContent content_of(const Scenario& scenario);

// Curvature near the scored voxels, and which of them are convex.
struct ConvexityStage {
  CurvatureOptions curvature;
  bool of_voxel_means = true;  // a dense part of a scan has no more weight than a sparse one
  double zero_plane_m = 0.0;   // of CurvatureMethod::thesis: convex points are above it
  double distance_m = 0.01;    // a voxel this close to a convex point counts as convex
};

// Which scored voxels are graspable.
struct GraspableRule {
  Method method = Method::calibrated;
  int solid_voxel_threshold = 120;
  double score_threshold = 0.8;
  double zero_plane_m = 0.0;
  bool needs_convexity = false;
};

// What the stages of detect_tiles use of a scenario.
struct TileDetectionOptions {
  bool tilts_mask = false;                  // along the surface's normal
  std::optional<double> normal_radius_m;    // nothing: no normals and slopes are fitted
  std::optional<ConvexityStage> convexity;  // nothing: not evaluated
  GraspableRule graspable;
};
TileDetectionOptions tile_detection_options(const GripperMask& mask, const Scenario& scenario);

// What is known around the tiles: at least what lies in them and their halo.
struct TileSurroundings {
  const libmap::PointCloud& terrain;  // measured points, whose curvature is looked at
  const libmap::PointCloud& surface;  // the points that made the voxels
  const VoxelGrid& grid;              // with min and max of the whole terrain
};

struct TileDetectionResult {
  std::vector<MapVoxel> voxels;       // ascending
  std::size_t unoriented_voxels = 0;  // with a tilted mask: without a normal, so that it is upright
  std::size_t curvature_points = 0;   // whose curvature was measured
  std::size_t convex_points = 0;
  libmap::StageTimings timings_s;  // wall time of each step
};

// Which points' curvature is measured: those near the tiles, or all, which is the same where the
// tiles are all there are.
enum class CurvatureAt { points_near_tiles, all_points };

// Throws what the steps throw.
TileDetectionResult detect_tiles(const TileSurroundings& surroundings, const GripperMask& mask,
                                 const std::vector<TileBounds>& tiles, CurvatureAt curvature_at,
                                 const TileDetectionOptions& options,
                                 libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
