// Points aligned with a surface: point-to-plane ICP (Chen and Medioni 1992) with Tukey's biweight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/reference_surface.h"

namespace libmap {

struct SurfaceAlignmentOptions {
  double max_distance_m = 0.2;  // > 0: points farther from the surface are left out
  double min_overlap = 0.1;     // 0..1: share of the points that must be nearer, over the surface
  int max_iterations = 100;     // >= 1
  double tolerance_m = 1e-7;    // > 0: converged when no step moves the points by more (RMS)
  int max_points = 50000;       // >= 6: so many of the points are used, evenly over the list
  // 0..1: a motion whose curvature in the sum of squares is a smaller share of the greatest one is
  // not determined by the surface and is left alone (Zhang, Kaess and Singh 2016): a plane does not
  // slide, a ball does not turn.
  double min_curvature = 1e-4;
};
void bind(ParameterTable& table, SurfaceAlignmentOptions& options);

struct SurfaceAlignmentResult {
  Pose surface_from_points = Pose::Identity();
  bool converged = false;
  int iterations = 0;
  int free_motions = 0;    // of six, left alone in the last step
  double curvature = 0.0;  // the least one that was used, as a share of the greatest
  std::size_t points = 0;  // used
  std::size_t overlap =
      0;  // of them nearer than max_distance_m and not beyond a border, at the end
  std::size_t inliers = 0;  // of those the ones with a weight
  double rmse_m = 0.0;      // of the inliers' distances
};

// The rigid motion of `points` after which the weighted squares of their distances along the
// surface's normals are least. Points whose nearest place is on the surface's border have no
// counterpart. Weights come from 1.4826 times the median distance in each step, so fewer than half
// of the points that overlap may be wrong. The same for any number of threads. Throws Error:
// options out of their ranges, fewer than six points, one that is not finite, a surface without
// sides, too little overlap in some step.
SurfaceAlignmentResult align_to_surface(const std::vector<Eigen::Vector3d>& points,
                                        const ReferenceSurface& surface,
                                        const SurfaceAlignmentOptions& options = {});

}  // namespace libmap
