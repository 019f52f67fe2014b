// Fills a terrain's gaps: the points' heights, linear on their Delaunay triangulation, at the nodes
// of a regular grid ("Graspable Target Detection for Hexapod Robots", 2023, eq. 3-5, listing A.3).
#pragma once

#include <cstddef>

#include "libmap/core/point_cloud.h"

namespace libgtd {

// thesis: the grid begins at the points' least x and y, its pitch is that of the author's program,
// nodes of height exactly 0 are dropped, and coordinates are rounded to single precision.
// corrected: the pitch of eq. 3-5 as printed; nodes are whole multiples of it in the input's frame.
enum class InterpolationMethod { thesis, corrected };

struct InterpolationOptions {
  InterpolationMethod method = InterpolationMethod::corrected;
  // Triangles with an edge longer than this in the x-y plane are refused; 0 sets no limit. Not in
  // space: a cliff has long edges where the points are dense all the same.
  double max_edge_m = 0;
  // Pitch of the grid with `corrected`; 0 takes it from eq. 3-5. Tiles that shall agree share one.
  double grid_spacing_m = 0;
  // Upper bound of the pitch that eq. 3-5 gives, 0 for none: nodes farther apart than the voxels
  // that they shall fill leave rows of them empty. Corrected only.
  double max_grid_spacing_m = 0;
  // Side of the square cells whose number measures the area A of eq. 3-5 with `corrected`; 0 takes
  // 4 times the mean spacing of as many points in the bounding box, whose area bounds A then.
  double area_cell_m = 0;
  // More nodes than this are an error: a pitch or a stray point that is wrong, not a terrain.
  std::size_t max_nodes = 100'000'000;
  // So are more than this for each finite point, beyond the first million: a few points that lie
  // far apart are none either.
  std::size_t max_nodes_a_point = 100;
};

struct InterpolationResult {
  libmap::PointCloud cloud;  // x outer, y inner; positions alone, and the input's viewpoint
  double grid_spacing_m = 0;
  double area_m2 = 0;                 // thesis: of the bounding box; corrected: of occupied cells
  std::size_t triangles = 0;          // of the triangulation
  std::size_t refused_triangles = 0;  // longer than max_edge_m
  std::size_t nodes = 0;              // of the grid
  std::size_t outside_nodes = 0;      // outside the hull or in refused triangles
  std::size_t zero_nodes = 0;         // dropped by `thesis` for a height of exactly 0
  std::size_t skipped_points = 0;     // not finite, or under another point of the same x and y
};

// The cloud's frame is the terrain frame, z up. Throws Error for an option out of its range, for
// fewer than 3 finite points, and for points whose x and y all lie on one line.
InterpolationResult interpolate(const libmap::PointCloud& cloud,
                                const InterpolationOptions& options = {});

}  // namespace libgtd
