// Where the terrain is convex, so that spines find something to hold, and what lies near such
// places ("Graspable Target Detection for Hexapod Robots", 2023, listings 3.2 and 3.3).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "libgtd/shape/curvature.h"

namespace libgtd {

struct ConvexityOptions {
  // Corrected: both principal curvatures exceed this, in 1/m, away from the outside. Nothing: 0.1
  // over the radius of the estimate, 1.1/m at 0.09 m, so that a convex place falls off by a
  // twentieth of the radius within it (4.5 mm at 0.09 m); 2 mm of noise on 200 neighbors within
  // 0.09 m bends a plane by 0.17/m (standard deviation).
  std::optional<double> min_curvature_per_m = std::nullopt;
  // Thesis: k1 * k2 exceeds this (listing 3.2). PCL's curvature of a ball of radius R is about
  // (radius / 2R)^2, so that balls of less than 3.3 times the radius count: 0.3 m at 0.09 m ...
  double min_gaussian_curvature = 0.0005;
  // ... and the point lies above this height of the terrain frame.
  double zero_plane_m = 0;
};

// 1 for each convex point of `curvature`, else 0; by the rule of the method that estimated it.
// `positions` in the terrain frame are those of curvature.points. Points without a curvature are
// not convex. Throws Error for arrays of different length and for bounds that are NaN.
std::vector<std::uint8_t> find_convex(const CurvatureResult& curvature,
                                      const std::vector<Eigen::Vector3d>& positions,
                                      const ConvexityOptions& options = {});

// 1 for each position closer than `distance_m` to one of `convex_points`, else 0 (the intersection,
// listing 3.3). Points that are not finite are near to nothing. Throws Error for a distance that is
// not positive.
std::vector<std::uint8_t> mark_near_convex(const std::vector<Eigen::Vector3d>& positions,
                                           const std::vector<Eigen::Vector3d>& convex_points,
                                           double distance_m);

}  // namespace libgtd
