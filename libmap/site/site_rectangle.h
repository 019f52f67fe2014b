// Where a rectangle of a given size lies wholly inside what was measured.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/parameters.h"

namespace libmap {

struct SiteRectangleOptions {
  double cell_m = 0.01;    // > 0: to which the data's border is known; coarser for large data
  double max_gap_m = 0.2;  // >= 0: a hole counts as data if no square of this size fits into it
  double margin_m = 0.0;   // >= 0: that must be left to holes and to the data's border
};
void bind(ParameterTable& table, SiteRectangleOptions& options);

struct SiteRectangle {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double yaw_deg = 0.0;  // of its first side from the x axis; -45..45 for a square, else -90..90
  double clearance_m = 0.0;  // by which it could grow on every side and still lie inside
};

// The rectangle size_m.x() along its own x axis and size_m.y() along y that has the largest
// clearance, over all places and directions; among equals the least turned, in their middle.
// `points` are the data seen from above, spread so densely that no gap between neighbors is as
// wide as max_gap_m. A rectangle fits if no more than one cell is missing. Throws Error: options
// out of their ranges, no point, none fits (it names the largest that does).
SiteRectangle find_site_rectangle(const std::vector<Eigen::Vector2d>& points,
                                  const Eigen::Vector2d& size_m,
                                  const SiteRectangleOptions& options = {});

}  // namespace libmap
