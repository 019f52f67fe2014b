// Heights checked at places along the edges of a site, as in table B 2-2 of "Graspable Target
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

// The corners counter-clockwise, seen from above, from the one with the least x and y on. Edge a
// (y = min) runs from the first to the second, b (x = max) to the third, c (y = max) to the fourth,
// d (x = min) back.
struct SiteCorners {
  std::array<Eigen::Vector2d, 4> corners{};
};

// The least rectangle around the points: along the axes, or `turned` by up to 45 degrees so that
// its area is least. Throws Error if there is no point or the rectangle has no area.
SiteCorners bounding_corners(const std::vector<Eigen::Vector3d>& points, bool turned);
SiteCorners corners_of(const Eigen::Vector2d& min, const Eigen::Vector2d& max);

// The height of a surface at a place, m; nothing where there is none.
using HeightFunction = std::function<std::optional<double>(const Eigen::Vector2d& place)>;

// Of a mesh: where a vertical ray from `from_z` downwards meets it first.
HeightFunction heights_of(const TriangleMesh& mesh,
                          double from_z = std::numeric_limits<double>::infinity());
// Of a cloud: the median z of the points within `radius_m` of the vertical through the place;
// nothing where there are fewer than `min_points`.
HeightFunction heights_of(const std::vector<Eigen::Vector3d>& points, double radius_m,
                          int min_points);

struct SpotCheckOptions {
  int places = 7;         // along each edge, in the middles of as many equal parts; >= 1
  double inset_m = 0.05;  // of the places from the edge; >= 0
};
void bind(ParameterTable& table, SpotCheckOptions& options);

struct SpotCheckPlace {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  std::optional<double> height_m{};
  std::optional<double> ground_m{};

  // Height above the ground, where both are known.
  std::optional<double> error_m() const {
    if (!height_m || !ground_m) return std::nullopt;
    return *height_m - *ground_m;
  }
};

struct SpotCheckResult {
  std::array<std::vector<SpotCheckPlace>, 4> edges;  // a, b, c, d
  std::array<std::optional<double>, 4> mean_m;       // of the sizes of each edge's errors
  std::size_t measured = 0;                          // places with an error
  std::size_t missing = 0;                           // and without
  double mean_abs_error_m = 0.0;                     // of all errors' sizes
  double mean_error_m = 0.0;                         // with their signs
  double max_abs_error_m = 0.0;
};

// Throws Error: options out of their ranges, an inset of half a side or more, no place with an
// error.
SpotCheckResult check_edges(const SiteCorners& site, const HeightFunction& surface,
                            const HeightFunction& ground, const SpotCheckOptions& options = {});

}  // namespace libmap
