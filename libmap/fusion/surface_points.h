// Converts refined surface elements to a cloud with one point per voxel, and removes points that
// other views contradict (last step of fusion).
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/fusion/surface_refinement.h"
#include "libmap/fusion/tile_mask.h"

namespace libmap {

// Side, in voxels, of blocks of the x-y plane. Points that only one or two frames measured are
// dropped from a block if other frames contradict (see through or miss) at least half of them in
// the block and its eight neighbors.
inline constexpr int contradiction_block = 16;

struct SurfacePointOptions {
  int min_views = 1;  // minimum number of distinct frames that measured a point
  // Maximum ratio of views that see through a point to views that see the point, weighted by the
  // cosine of incidence (Merrell et al. 2007).
  double max_seen_through = 0.3;
  // Maximum ratio of views that measured no depth around a point, although it is in range and not
  // oblique, to views that see the point. Removes moving objects in front of an open background.
  double max_missed = 1.5;
};

struct SurfacePointCounts {
  std::size_t unconfirmed = 0;      // dropped: measured by too few frames
  std::size_t max_views = 0;        // maximum number of frames that measured one element
  std::size_t seen_through = 0;     // dropped: views see through the points
  std::size_t missed = 0;           // dropped: views measured nothing at the points
  std::size_t contradicted = 0;     // dropped: measured by one or two frames, in or beside a block
                                    // with many contradicted points (contradiction_block)
  std::size_t beyond_edge = 0;      // dropped: extended points that refinement moved too far
  std::size_t merged = 0;           // merged with another point of the same or the next voxel
  std::size_t extended_points = 0;  // points of the cloud beyond measured edges
};

struct SurfacePoints {
  // Normals; colors if the surface has colors; fields as in DepthFusionResult::cloud.
  PointCloud cloud;
  SurfacePointCounts counts;
};
// Makes points of the refined elements: drops contradicted elements, keeps one point per voxel and
// extends edges. Returns and counts only points in the columns of voxels `cells`.
SurfacePoints make_surface_points(const RefinedSurface& surface, double voxel_size_m,
                                  const TileMask& cells, const SurfacePointOptions& options);

// Replaces each unit normal of `cloud` by the normal of a plane, fitted by weighted total least
// squares to the points within `radius_m` with normals that differ by less than 45 degrees (Hoppe
// et al. 1992). `deviations_m` has one standard deviation per point. Orientations do not change.
// The normal is kept if the neighbors do not determine a plane.
void fit_normals(PointCloud& cloud, double radius_m, const std::vector<double>& deviations_m);

}  // namespace libmap
