// Fits surface normals and slopes of a terrain to the points within a radius.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libgtd {

struct SurfaceNormalOptions {
  double radius_m = 0.07;  // radius of the ball of points for the plane fit
  // Direction from which slopes are measured; also the outside direction of positions without a
  // usable one (fit_surface_normals).
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

struct SurfaceNormal {
  static constexpr float nan = std::numeric_limits<float>::quiet_NaN();

  // Unit normal, outward. NaN if the points within the radius (at least three) do not determine a
  // plane, or if neither the outside direction nor `up` determines the sign.
  Eigen::Vector3f normal = Eigen::Vector3f::Constant(nan);
  // Angle between the normal and `up`: 0 level, 90 a wall, above 90 an overhang. At most 90 if `up`
  // is the outside direction. NaN if the points do not determine a plane.
  float slope_deg = nan;
};

// Returns the cosine between a unit normal and the direction `outside` of any length. The sign is
// the side of the surface. 0 if `outside` is zero, not finite or within 0.06 deg of the surface.
double side_of(const Eigen::Vector3d& normal, const Eigen::Vector3d& outside);

// Returns true if points with these eigenvalues of their covariance (ascending) determine a plane.
// Points on a line or distributed evenly in all directions do not.
inline bool determines_plane(const Eigen::Vector3d& variances) {
  constexpr double min_width_ratio = 1e-6;
  constexpr double max_lump_ratio = 0.8;
  return variances[1] > min_width_ratio * variances[2] &&
         !(variances[0] > max_lump_ratio * variances[1]);
}

// Fits the regression plane (eq. 2-13..2-15) to the points of the cloud within the radius of each
// of `positions` (m). Normals face `outsides`, directions of any length, one per position or none
// at all. `up` replaces a direction that is missing, zero, not finite or along the surface. A
// result does not depend on points outside the radius, other positions or the number of threads.
// Throws Error for a radius that is not positive, an `up` of length 0, and lists of unequal length.
std::vector<SurfaceNormal> fit_surface_normals(const libmap::PointCloud& cloud,
                                               const std::vector<Eigen::Vector3d>& positions,
                                               const std::vector<Eigen::Vector3f>& outsides,
                                               const SurfaceNormalOptions& options);

}  // namespace libgtd
