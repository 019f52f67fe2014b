// Height field of a site for MuJoCo, which collides meshes only by convex hulls.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct HeightFieldOptions {
  double cell_size_m = 0.005;      // > 0
  double max_deviation_m = 0.002;  // > 0: cells with a larger deviation are skipped
};

// The nodes are at multiples of the cell size. Diagonals of cells run from the lowest to the
// highest indices.
struct HeightField {
  double cell_size_m = 0.0;
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // node (0, 0)
  std::size_t columns = 0;                             // nodes along x
  std::size_t rows = 0;                                // nodes along y
  double base_m = 0.0;                                 // z of height 0
  std::vector<float> heights_m;                        // above base_m, row by row
  // Cells, (columns - 1) x (rows - 1), that another shape must cover: the surface overhangs, or the
  // field deviates from it. Nodes that belong only to such cells are below the surface.
  std::vector<bool> is_missing;
  std::size_t missing_cells = 0;
  // In the other cells no point of the field is farther from the surface, and no point of the
  // surface above these cells farther from the field. The field may exceed the surface's border by
  // one cell.
  double deviation_m = 0.0;

  // Lowest and highest node, m above base_m.
  float min_m() const;
  float max_m() const;
  // First and last column, first and last row of the cells that a triangle's box touches.
  std::array<std::size_t, 4> cells_of(const std::array<Eigen::Vector3d, 3>& corners) const;
};

// The lowest surface that faces up. Throws Error: no triangle faces up, or more than 2^26 nodes.
HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options);

// Returns true if a triangle is above or below a cell that is skipped.
bool is_above_missing(const HeightField& field, const TriangleMesh& mesh, const Triangle& triangle);

}  // namespace libmap
