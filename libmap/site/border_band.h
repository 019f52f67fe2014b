// A white band on the ground, of boards or tape, that frames the test area.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

struct BorderBandOptions {
  double cell_m = 0.01;  // > 0: of the picture from above that the band is looked for in
  // 0..255: a place is white if the least of its red, green and blue is at least this. 0: half way
  // from what is usual to the brightest half percent.
  double white_level = 0.0;
  double max_width_m = 0.25;  // > 0: of the band
  double min_side_m = 0.5;    // > 0: of the area inside
  double min_seen = 0.4;      // (0, 1]: share of each side's length along which white was found
  double min_z_m = -0.1;      // heights at which the band may lie
  double max_z_m = 0.15;
};
void bind(ParameterTable& table, BorderBandOptions& options);

struct BorderBand {
  std::vector<Eigen::Vector2d> corners;  // of the area inside the band, counter-clockwise
  std::array<double, 4> sides_m{};       // the same without the margin: of the band's inner edge
  double seen = 0.0;                     // least share of a side along which white was found
  double white_level = 0.0;
};

// The quadrilateral inside the band. A first search tries every direction and pairs of white lines
// along and across it, and takes the rectangle with the most white along all four sides; then each
// side's inner edge, where white ends, is found slice by slice and a line is fitted to it robustly,
// so that gaps in the band and white rocks that touch it do no harm. Sides need not be parallel.
// `level_cloud`: colored points, ground at z = 0, spread more densely than cell_m. Each side lies
// `margin_m` inside the edge found. Throws Error: no colors, no white, no band.
BorderBand find_border_band(const PointCloud& level_cloud, double margin_m = 0.0,
                            const BorderBandOptions& options = {});

// What lengths are to be multiplied by.
struct BorderScale {
  double factor = 1.0;
  // Standard deviation of the factor, by the scatter of the sides. Opposite sides end at the same
  // two edges: the four count as two. An error that all edges share is not in it.
  double deviation = 0.0;
};

// By least squares, from the true lengths of the band's inner edge in either order. Throws Error if
// a side differs from its length by more than 5 %: the band is another one.
BorderScale scale_by_border(const BorderBand& band, const Eigen::Vector2d& inner_size_m);

}  // namespace libmap
