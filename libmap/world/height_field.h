// Samples a surface as a grid of heights, for simulators that collide only convex hulls.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct HeightFieldOptions {
  double cell_size_m = 0.005;      // > 0
  double max_deviation_m = 0.002;  // > 0: cells with a larger deviation are missing
};

// The nodes are at multiples of the cell size. The diagonal of each cell runs from the lowest to
// the highest indices.
struct HeightField {
  double cell_size_m = 0.0;
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // x and y of node (0, 0)
  std::size_t columns = 0;                             // nodes along x
  std::size_t rows = 0;                                // nodes along y
  double base_m = 0.0;                                 // z of height 0
  std::vector<float> heights_m;                        // above base_m, row by row; the lowest is 0
  // True for the cells, (columns - 1) x (rows - 1) row by row, that another shape must replace: the
  // surface overhangs or the field deviates from it there or in a neighboring cell. Nodes between
  // missing cells are below the surface.
  std::vector<bool> is_missing;
  // Maximum distance between the field and the surface in cells that are not missing, in both
  // directions. The field may exceed the surface's border by one cell.
  double deviation_m = 0.0;
};

// Samples the lowest surface that faces up (z) at each node. Throws Error if no triangle faces up,
// or the grid has more than 2^26 nodes.
HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options);

// Returns false only if no point of the triangle is above or below a missing cell.
bool may_be_left_out(const HeightField& field, const TriangleMesh& mesh, const Triangle& triangle);

}  // namespace libmap
