// Refined elements of a surface as a cloud: one point per voxel, without those that views
// contradict.
#pragma once

#include <cstddef>

#include "libmap/cloud/plan_cells.h"
#include "libmap/cloud/surface_refinement.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

// Side, in voxels, of the squares of the plan in which measurements of one or two frames are
// evaluated together, each square with the eight around it.
inline constexpr int contradiction_block = 16;

struct SurfacePointOptions {
  double voxel_size_m = 0.01;     // > 0
  int min_views = 1;              // frames that must have measured a point
  double max_seen_through = 0.3;  // views that see through a point for each that sees it
  double max_missed = 1.5;        // views that miss it for each that sees it
  PlanCells cells;                // columns of voxels whose points are returned and counted
};

struct SurfacePointCounts {
  std::size_t unconfirmed = 0;      // dropped: measured by too few frames
  std::size_t max_views = 0;        // frames that measured one element, at most
  std::size_t seen_through = 0;     // dropped: views see through them
  std::size_t missed = 0;           // dropped: views measured nothing there
  std::size_t beside = 0;           // dropped: one or two frames measured them, and others
                                    // contradict most of what such frames measured above,
                                    // below and beside them
  std::size_t bent_away = 0;        // dropped: beyond an edge where the surface does not go on
  std::size_t merged = 0;           // with another one of the same voxel, or an echo of one
  std::size_t extended_points = 0;  // of the cloud: beyond the edges
};

struct SurfacePoints {
  // With normals, colors if the surface has them, and the fields `views` and `expected_error`.
  PointCloud cloud;
  SurfacePointCounts counts;
};
// The refined elements as points: contradicted ones dropped, one left per voxel, edges extended.
SurfacePoints make_surface_points(const RefinedSurface& surface,
                                  const SurfacePointOptions& options);

}  // namespace libmap
