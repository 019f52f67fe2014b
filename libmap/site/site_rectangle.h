// Finds the best-centered rectangle of a given size inside the measured area, for cropping.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/parameters.h"

namespace libmap {

struct SiteRectangleOptions {
  double cell_m = 0.01;  // > 0: cell size of the mask of the measured area; larger for large areas
  double max_gap_m = 0.2;  // >= 0: holes that contain no square of this size are filled
  double margin_m = 0.0;   // >= 0: minimum distance from holes and from the area's border
};
void bind(ParameterTable& table, SiteRectangleOptions& options);

struct SiteRectangle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double yaw_deg = 0.0;  // of the rectangle's x axis: -45 to 45 for a square, otherwise -90 to 90
  double clearance_m = 0.0;  // distance by which every side could move outwards
};

// Finds the rectangle with the largest clearance, over all positions and directions. Its sides are
// size_m.x() along its x axis and size_m.y() along its y axis. Among equal rectangles, the smallest
// rotation and the mean position are used. `points` are the measured points in the x-y plane, with
// gaps below max_gap_m between neighbors. Clearances down to one cell below margin_m are accepted.
// Throws Error if an option or the size is invalid, there is no point, the points extend too far
// for a site of this size, or no rectangle fits (the error's bound is the largest size that fits).
SiteRectangle find_site_rectangle(const std::vector<Eigen::Vector2d>& points,
                                  const Eigen::Vector2d& size_m,
                                  const SiteRectangleOptions& options = {});

}  // namespace libmap
