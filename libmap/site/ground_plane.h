// Finds the plane of the ground under rocks, walls and tables.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace libmap {

struct GroundPlaneOptions {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // approximate up direction, of any length
  double tolerance_m = 0.02;                      // > 0: maximum distance of inliers from a plane
  double max_tilt_deg = 40.0;  // > 0, < 90: maximum angle between the ground's normal and `up`
  double min_fraction = 0.05;  // (0, 1]: minimum share of the points on a plane
  // (0, 1]: minimum size of a lower plane to be the ground, relative to the largest plane.
  double min_fraction_of_largest = 0.2;
  int hypotheses = 3000;  // > 0: number of RANSAC hypotheses per plane
  std::uint64_t seed = 1;
};
// Binds all fields except `up`.
void bind(ParameterTable& table, GroundPlaneOptions& options);

struct GroundPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit, up
  double offset_m = 0.0;                              // normal . p = offset_m on the plane
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   // of the inliers, projected to the plane
  double rmse_m = 0.0;                                // root mean square distance of the inliers
  std::size_t inliers = 0;                            // number of points within the tolerance
  double fraction = 0.0;                              // inliers as a share of all points
  double tilt_deg = 0.0;                              // angle between the normal and `up`
};

// Finds the lowest large plane within max_tilt_deg of up. Planes are extracted one after the other
// by RANSAC (Fischler and Bolles 1981). The ground is the lowest plane, refined by iterated least
// squares with Tukey's weights, so that the feet of rocks do not lift the plane. Points must be
// finite and evenly distributed over the surface, because all points have equal weight. The result
// does not depend on the number of threads. Throws Error if an option is out of range, there are
// fewer than three points, all points are on a line, or no plane is found.
GroundPlane find_ground_plane(const std::vector<Eigen::Vector3d>& points,
                              const GroundPlaneOptions& options = {});

// Transform that moves the plane to z = 0 with the smallest rotation. Keeps x and y of `center`.
Pose level_from_map(const GroundPlane& plane);

}  // namespace libmap
