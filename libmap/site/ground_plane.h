// The plane of the ground under rocks, walls and tables.
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
  // Which way is up, of any length.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double tolerance_m = 0.02;   // > 0: points this near to a plane lie on it
  double max_tilt_deg = 40.0;  // > 0, < 90: of the ground's normal from `up`
  // Of all points, a plane must hold at least this share to be one, (0, 1].
  double min_share = 0.05;
  // Of the points of the largest plane, another must hold this share to be taken for the ground
  // because it lies lower, (0, 1].
  double min_share_of_largest = 0.2;
  int hypotheses = 3000;  // > 0: planes through three points that are tried for each plane
  std::uint64_t seed = 1;
};
// All but `up`: ground_tolerance_m, max_tilt_deg, min_ground_share, ...
void bind(ParameterTable& table, GroundPlaneOptions& options);

struct GroundPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit, up
  double offset_m = 0.0;                              // normal . p = offset_m on the plane
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   // of the inliers, on the plane
  double rmse_m = 0.0;                                // of the inliers
  std::size_t inliers = 0;                            // points within the tolerance
  double share = 0.0;                                 // of all points
  double tilt_deg = 0.0;                              // of the normal from `up`
};

// The lowest large plane within max_tilt_deg of up. Planes are found one after the other, each by
// RANSAC (Fischler and Bolles 1981) among the points that the ones before do not hold; the ground
// is the one that the others lie above. It is then fitted to its inliers by least squares with
// Tukey's weights until it stands still, so that the feet of rocks do not lift it. Every point
// counts alike: give finite points that are spread evenly over the surface. The same for any number
// of threads. Throws Error: options out of their ranges, fewer than three points, all on one line,
// no plane.
GroundPlane find_ground_plane(const std::vector<Eigen::Vector3d>& points,
                              const GroundPlaneOptions& options = {});

// Carries the plane to z = 0 by the least rotation, about `center`: x and y of the ground stay as
// near as that allows.
Pose level_from_map(const GroundPlane& plane);

}  // namespace libmap
