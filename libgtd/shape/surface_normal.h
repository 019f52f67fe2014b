// Which way the terrain's surface faces at a place, at the scale of what stands on it.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libgtd {

struct SurfaceNormalOptions {
  double radius_m = 0.07;  // of the ball of points that the plane is fitted to
  // The outside where a place has none of its own; slopes are measured from it.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

struct SurfaceNormal {
  static constexpr float nan = std::numeric_limits<float>::quiet_NaN();

  // Of unit length, outward. NaN where fewer than three points lie within the radius, where they
  // are a line or a lump, or where the surface stands along `up` and has no outside of its own.
  Eigen::Vector3f normal = Eigen::Vector3f::Constant(nan);
  // Angle between the surface's outside and `up`: 0 level, 90 a wall, beyond that an overhang. At
  // most 90 where the place has no outside of its own. NaN where no plane can be fitted.
  float slope_deg = nan;
};

// On which side of a surface with this unit normal `outside` is, a direction of any length: the
// cosine between both. 0 if it is zero, not finite or within 0.06 deg of the surface.
double side_of(const Eigen::Vector3d& normal, const Eigen::Vector3d& outside);

// Whether points determine a plane, by the eigenvalues of their covariance in ascending order: they
// are neither a line nor a lump that no plane fits better than another.
inline bool determines_plane(const Eigen::Vector3d& variances) {
  constexpr double min_width_ratio = 1e-6;
  constexpr double max_lump_ratio = 0.8;
  return variances[1] > min_width_ratio * variances[2] &&
         !(variances[0] > max_lump_ratio * variances[1]);
}

// The normal of the regression plane (eq. 2-13..2-15) of the cloud's points within the radius, at
// each of `places`. It faces `outsides` there, directions of any length, as many as there are
// places or none; where that is zero, not finite or along the surface, it faces `up`. Nothing
// depends on points farther off, on the other places or on the number of threads. Throws Error: a
// radius that is not positive, an `up` of no length, arrays of different length.
std::vector<SurfaceNormal> fit_surface_normals(const libmap::PointCloud& cloud,
                                               const std::vector<Eigen::Vector3d>& places,
                                               const std::vector<Eigen::Vector3f>& outsides,
                                               const SurfaceNormalOptions& options);

}  // namespace libgtd
