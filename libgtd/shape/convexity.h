// Finds convex points of a terrain, where spines can engage, and the positions near convex points
// ("Graspable Target Detection for Hexapod Robots", 2023, listings 3.2 and 3.3).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "libgtd/shape/curvature.h"

namespace libgtd {

struct ConvexityOptions {
  // CurvatureMethod::corrected: lower bound of both principal curvatures of a convex point, 1/m.
  // nullopt: 0.1 / radius of the estimate (1.1/m for 0.09 m); the surface then falls by a twentieth
  // of the radius (4.5 mm for 0.09 m) at the distance of the radius from a convex point. Noise of 2
  // mm on 200 neighbors within 0.09 m bends a plane by 0.17/m (standard deviation).
  std::optional<double> min_curvature_per_m = std::nullopt;
  // CurvatureMethod::thesis: lower bound of k1 * k2 of a convex point (listing 3.2). PCL's
  // curvature of a ball of radius R is about (r / 2R)^2 for a radius r of the estimate, so that
  // balls with R below 3.3 r are convex (0.3 m for 0.09 m).
  double min_gaussian_curvature = 0.0005;
  // CurvatureMethod::thesis: lower bound of the height of a convex point, terrain frame.
  double zero_plane_m = 0;
};

// Returns 1 for each convex point of `curvature`, else 0, by the rule for curvature.method.
// `positions` are the positions of curvature.points in the terrain frame. Points without a
// curvature are not convex. Throws Error for arrays of different length and for NaN bounds.
std::vector<std::uint8_t> find_convex(const CurvatureResult& curvature,
                                      const std::vector<Eigen::Vector3d>& positions,
                                      const ConvexityOptions& options = {});

// Returns 1 for each position closer than `distance_m` to one of `convex_points`, else 0 (the
// intersection, listing 3.3). Points that are not finite are ignored. Throws Error for a distance
// that is not positive.
std::vector<std::uint8_t> mark_near_convex(const std::vector<Eigen::Vector3d>& positions,
                                           const std::vector<Eigen::Vector3d>& convex_points,
                                           double distance_m);

}  // namespace libgtd
