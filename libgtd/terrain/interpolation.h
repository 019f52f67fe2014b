// Fills gaps of a terrain: interpolates heights linearly on the Delaunay triangulation of the
// points, at the nodes of a regular grid ("Graspable Target Detection for Hexapod Robots", 2023,
// listing A.3). For n points on the area A, the spacing is 1 / sqrt(5 n / (3 A)) (eq. 3-5).
#pragma once

#include <cstddef>

#include "libmap/core/point_cloud.h"

namespace libgtd {

// thesis: the grid starts at the minimum x and y of the points, has the author's spacing (1 /
// sqrt(n / A), rounded), drops nodes of height exactly 0 and rounds coordinates to single
// precision. corrected: the spacing follows eq. 3-5, and nodes are at its multiples.
enum class InterpolationMethod { thesis, corrected };

struct InterpolationOptions {
  InterpolationMethod method = InterpolationMethod::corrected;
  // Maximum edge length of a triangle in the x-y plane; 0: no limit. Edges are not measured in 3D,
  // because cliffs have long edges even between dense points.
  double max_edge_m = 0;
  // Spacing of the nodes for `corrected`; 0: from eq. 3-5. Must be the same for all tiles.
  double grid_spacing_m = 0;
  // Maximum spacing for `corrected`; 0: no limit. Rows of voxels remain empty if the spacing
  // exceeds the voxel size.
  double max_grid_spacing_m = 0;
  // For `corrected`: side of square cells; A in eq. 3-5 is the area of the cells with points. 0:
  // four times the spacing of points that are spread evenly over the bounding box.
  double area_cell_m = 0;
  // Maximum number of nodes. More nodes indicate a wrong spacing or a stray point.
  std::size_t max_nodes = 100'000'000;
  // Maximum number of nodes per finite point, beyond the first million nodes. More nodes indicate a
  // few points that are far apart.
  std::size_t max_nodes_per_point = 100;
};

struct InterpolationResult {
  libmap::PointCloud cloud;  // nodes, ascending by x, then y, and the viewpoint of the input
  double grid_spacing_m = 0;
  double area_m2 = 0;                  // A: bounding box (thesis), occupied cells (corrected)
  std::size_t triangles = 0;           // triangles of the triangulation
  std::size_t rejected_triangles = 0;  // triangles with an edge longer than max_edge_m
  std::size_t nodes = 0;               // grid nodes
  std::size_t outside_nodes = 0;   // dropped nodes outside the hull or inside rejected triangles
  std::size_t zero_nodes = 0;      // nodes that `thesis` dropped: height exactly 0
  std::size_t skipped_points = 0;  // not finite, or below a point with the same x and y
};

// Interpolates `cloud`, which is in the terrain frame (z up, meters). Throws Error for an option
// out of range, fewer than 3 finite points, collinear x and y, or too many nodes.
InterpolationResult interpolate(const libmap::PointCloud& cloud,
                                const InterpolationOptions& options = {});

}  // namespace libgtd
