// Samples a surface as a grid of heights, for simulators that collide meshes as convex hulls.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct HeightFieldOptions {
  double cell_size_m = 0.005;      // > 0: distance between nodes
  double max_deviation_m = 0.002;  // > 0: cells that deviate more from the surface are missing
};

// The coordinates of nodes are multiples of the cell size. Each cell consists of two triangles,
// divided by the diagonal from its lowest to its highest indices.
struct HeightField {
  double cell_size_m = 0.0;                            // distance between nodes
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // x and y of node (0, 0)
  std::size_t columns = 0;                             // nodes along x
  std::size_t rows = 0;                                // nodes along y
  double base_m = 0.0;                                 // z of height 0
  std::vector<float> heights_m;                        // above base_m, row by row; the lowest is 0
  // True for missing cells; (columns - 1) x (rows - 1) entries, row by row. Another shape must
  // replace these cells, because the surface overhangs or deviates from the field in the cell or in
  // a neighboring cell. Nodes between missing cells are below the surface.
  std::vector<bool> is_missing;
  // Maximum distance between field and surface, in both directions, in cells that are not missing.
  // The field may extend beyond the border of the surface by one cell.
  double deviation_m = 0.0;
};

// Samples at each node the lowest surface that faces up (+z). Throws Error if no triangle faces up,
// or the grid has more than 2^26 nodes.
HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options);

// True if a missing cell is in the triangle's box in x and y: the field may omit a part of it.
bool may_be_left_out(const HeightField& field, const TriangleMesh& mesh, const Triangle& triangle);

}  // namespace libmap
