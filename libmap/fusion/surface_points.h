// Refined elements of a surface as a cloud: one point per voxel, without those that views
// contradict.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/fusion/surface_refinement.h"
#include "libmap/fusion/tile_mask.h"

namespace libmap {

// Side, in voxels, of the squares of the plan in which measurements of one or two frames are
// evaluated together, each square with the eight around it.
inline constexpr int contradiction_block = 16;

struct SurfacePointOptions {
  int min_views = 1;  // distinct frames that must have measured a point
  // Drops points that more views see through than see, each counted by its cosine (Merrell et al.
  // 2007). Larger values keep more.
  double max_seen_through = 0.3;
  // The same for views that measured nothing around a point, although it is within their range and
  // not seen obliquely: what moves before an open background.
  double max_missed = 1.5;
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
// Returns and counts the points in the columns of voxels `cells`.
SurfacePoints make_surface_points(const RefinedSurface& surface, double voxel_size_m,
                                  const TileMask& cells, const SurfacePointOptions& options);

// Replaces each normal of `cloud`, of unit length, by that of the plane of weighted total least
// squares through the points within `radius_m` whose normals look the same way (within 45 degrees;
// Hoppe et al. 1992). `deviations_m` are the points' own standard deviations, one each; sides are
// kept. A point whose neighbors span no plane keeps its normal.
void fit_normals(PointCloud& cloud, double radius_m, const std::vector<double>& deviations_m);

}  // namespace libmap
