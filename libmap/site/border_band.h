// Detects a white band of boards or tape that frames the test area on the ground.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

struct BorderBandOptions {
  double cell_m = 0.01;  // > 0: cell size of the top view in which the band is detected
  // 0 to 255: minimum of red, green and blue of a white cell. 0: the mean of the median and the
  // 99.5 % quantile of all cells.
  double white_level = 0.0;
  double max_width_m = 0.25;  // > 0: maximum width of the band
  double min_side_m = 0.5;    // > 0: minimum side of the area inside the band
  double min_seen = 0.4;      // (0, 1]: minimum share of each side along which the band is visible
  double min_z_m = -0.1;      // minimum height of the band above the ground
  double max_z_m = 0.15;      // maximum height of the band above the ground
};
void bind(ParameterTable& table, BorderBandOptions& options);

struct BorderBand {
  std::vector<Eigen::Vector2d> corners;  // of the area inside the band, m, counter-clockwise
  std::array<double, 4> sides_m{};       // side lengths of the band's inner edge, without margin
  double seen = 0.0;                     // visible share of the least visible side
  double white_level = 0.0;              // level that was used
};

// Finds the quadrilateral inside the band. A first search over all directions and pairs of white
// lines finds the rectangle with the most white along the four sides. Then the inner edge of each
// side is detected slice by slice, and a line is fitted robustly, so that gaps in the band and
// white rocks that touch the band are tolerated. Sides need not be parallel. `level_cloud` contains
// colored points with the ground at z = 0 and a spacing below cell_m. The resulting corners are
// `margin_m` inside the detected edges. Throws Error if there are no colors, no points at the
// band's heights, or no band.
BorderBand find_border_band(const PointCloud& level_cloud, double margin_m = 0.0,
                            const BorderBandOptions& options = {});

// Correction of a map's scale.
struct BorderScale {
  double factor = 1.0;  // true length per length in the map
  // Standard deviation of the factor, from the scatter of the sides. Opposite sides are correlated,
  // so the four sides count as two. Errors that all sides share are not included.
  double deviation = 0.0;
};

// Estimates the scale by least squares from the true side lengths of the band's inner edge. The two
// lengths may be in either order. Throws Error if a side differs from its length by more than 5 %.
BorderScale scale_by_border(const BorderBand& band, const Eigen::Vector2d& inner_size_m);

}  // namespace libmap
