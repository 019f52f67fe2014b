// Height errors of a surface along the edges of a site, as in table B 2-2 of "Graspable Target
// Detection for Hexapod Robots" (2023).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Corners counter-clockwise in the x-y plane, starting at the minimum of x and y. Edge a (y = min)
// leads from the first to the second corner, b (x = max) to the third, c (y = max) to the fourth,
// d (x = min) to the first.
struct SiteCorners {
  std::array<Eigen::Vector2d, 4> corners{};
};

// Smallest rectangle around the points: parallel to the axes, or with `turned` rotated by up to 45
// degrees for minimum area. Throws Error if there is no point or the rectangle has no area.
SiteCorners bounding_corners(const std::vector<Eigen::Vector3d>& points, bool turned);
// Corners of the rectangle from min to max. Throws Error if it has no area.
SiteCorners corners_of(const Eigen::Vector2d& min, const Eigen::Vector2d& max);

// Height of a surface at a position in the x-y plane, m; nullopt if there is no surface.
using HeightFunction = std::function<std::optional<double>(const Eigen::Vector2d& position)>;

// Height of the first intersection of a mesh with a vertical ray downwards from `from_z`.
HeightFunction heights_of(const TriangleMesh& mesh,
                          double from_z = std::numeric_limits<double>::infinity());
// Median z of the points of a cloud within a horizontal distance of `radius_m`; nullopt if there
// are fewer than `min_points`.
HeightFunction heights_of(const std::vector<Eigen::Vector3d>& points, double radius_m,
                          int min_points);

struct EdgeCheckOptions {
  int positions_per_edge = 7;  // >= 1: positions at the centers of this many equal parts of an edge
  double inset_m = 0.05;       // >= 0: distance of the positions from the edge
};
void bind(ParameterTable& table, EdgeCheckOptions& options);

struct EdgeCheckPoint {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  std::optional<double> height_m{};  // height of the surface; nullopt: no surface at the position
  std::optional<double> ground_m{};  // height of the ground; nullopt: no ground at the position

  // Height of the surface above the ground; nullopt if height_m or ground_m is.
  std::optional<double> error_m() const {
    if (!height_m || !ground_m) return std::nullopt;
    return *height_m - *ground_m;
  }
};

struct EdgeCheckResult {
  std::array<std::vector<EdgeCheckPoint>, 4> edges;  // positions by edge: a, b, c, d
  std::array<std::optional<double>, 4> mean_m;       // mean absolute error by edge; nullopt: none
  std::size_t measured = 0;                          // positions with an error
  std::size_t missing = 0;                           // positions without an error
  double mean_abs_error_m = 0.0;                     // over all measured positions
  double mean_error_m = 0.0;                         // mean of the signed errors
  double max_abs_error_m = 0.0;
};

// Compares `surface` with `ground` at positions along the site's edges. Throws Error if an option
// is out of range, the inset is half of a side or more, or no position has both heights.
EdgeCheckResult check_edges(const SiteCorners& site, const HeightFunction& surface,
                            const HeightFunction& ground, const EdgeCheckOptions& options = {});

}  // namespace libmap
