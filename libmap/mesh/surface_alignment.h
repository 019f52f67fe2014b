// Aligns points with a surface by point-to-plane ICP (Chen and Medioni 1992) with Tukey's biweight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/reference_surface.h"

namespace libmap {

struct SurfaceAlignmentOptions {
  double max_distance_m = 0.2;  // > 0: points farther from the surface are ignored
  double min_overlap = 0.1;     // 0 to 1: minimum share of points within max_distance_m, else Error
  int max_iterations = 100;     // >= 1: maximum number of ICP iterations
  double tolerance_m = 1e-7;    // > 0: RMS displacement per step below which ICP has converged
  int max_points = 50000;       // >= 6: maximum number of points used, evenly over the list
  // 0 to 1: minimum eigenvalue of the ICP information matrix, relative to the largest eigenvalue.
  // Points are not moved along eigenvectors with smaller eigenvalues, which the surface does not
  // determine (Zhang, Kaess and Singh 2016), for example the translation along a plane.
  double min_curvature = 1e-4;
};
void bind(ParameterTable& table, SurfaceAlignmentOptions& options);

struct SurfaceAlignmentResult {
  Pose surface_from_points = Pose::Identity();
  bool converged = false;  // true if the last step was below tolerance_m
  int iterations = 0;
  int free_motions = 0;     // eigenvectors (of six) that were not determined in the last step
  double curvature = 0.0;   // smallest eigenvalue ratio >= min_curvature in the last step
  std::size_t points = 0;   // number of used points
  std::size_t overlap = 0;  // used points within max_distance_m and not beyond a border, at the end
  std::size_t inliers = 0;  // overlapping points with a weight above 0
  double rmse_m = 0.0;      // root mean square distance of the inliers from the surface
};

// Finds the rigid motion of `points`, from the identity, that minimizes the weighted squares of the
// points' distances along the surface normals. Points with a nearest point on the border are
// ignored. The scale of the weights is 1.4826 times the median distance in each step, so that up to
// half of the overlapping points may be outliers. Throws Error if an option is out of range, there
// are fewer than six points, a point is not finite, the surface is not oriented, or the overlap in
// a step is below min_overlap or six points.
SurfaceAlignmentResult align_to_surface(const std::vector<Eigen::Vector3d>& points,
                                        const ReferenceSurface& surface,
                                        const SurfaceAlignmentOptions& options = {});

}  // namespace libmap
