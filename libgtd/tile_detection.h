// The part of a detection that is done tile by tile: from points in the terrain frame and their
// voxels to the map's voxels. A tile needs what lies in it and in a halo around it, no more, and
// yields the same to the bit whatever else is there.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libgtd/score/scenario.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"
#include "libmap/core/stage_timer.h"

namespace libgtd {

// Whether a method prepares the cloud as the author's program does (`thesis`, `envelope`).
bool follows_thesis(Method method);

// Width of a tile. Throws Error naming tile_size_m.
int tile_voxels(const Scenario& scenario);

// How many columns around a tile its voxels depend on: the mask's window, the closing of the
// scanned area, and the points that decide on convexity with all their neighbours. Not of
// interpolation, which looks at the whole cloud.
int halo_voxels(const GripperMask& mask, const Scenario& scenario);

struct TileDetectionResult {
  std::vector<MapVoxel> voxels;      // ascending
  std::size_t curvature_points = 0;  // whose curvature was measured
  std::size_t convex_points = 0;
  libmap::StageTimings timings_s;  // wall time of each step
};

// Which points' curvature is measured: those near the tiles, or all, which is the same where the
// tiles are all there are.
enum class CurvatureAt { points_near_tiles, all_points };

// `terrain` and `grid` hold at least the points and voxels in the tiles and their halo; grid.min
// and grid.max are those of the whole terrain. Throws what the steps throw.
TileDetectionResult detect_tiles(const libmap::PointCloud& terrain, const VoxelGrid& grid,
                                 const GripperMask& mask, const std::vector<TileBounds>& tiles,
                                 CurvatureAt curvature_at, const Scenario& scenario,
                                 libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
