// A regular grid of heights for simulators that collide meshes only by their convex hulls.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct HeightFieldOptions {
  double cell_size_m = 0.005;      // > 0
  double max_deviation_m = 0.002;  // > 0: cells with a larger deviation are left out
};

// The nodes are at multiples of the cell size. The diagonal of each cell runs from its lowest to
// its highest indices.
struct HeightField {
  double cell_size_m = 0.0;
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // node (0, 0)
  std::size_t columns = 0;                             // nodes along x
  std::size_t rows = 0;                                // nodes along y
  double base_m = 0.0;                                 // z of height 0
  std::vector<float> heights_m;                        // above base_m, row by row; the lowest is 0
  // Cells, (columns - 1) x (rows - 1), that another shape must cover, because the surface overhangs
  // or the field deviates from it, and the cells around them. Nodes between them are below the
  // surface.
  std::vector<bool> is_missing;
  // In the other cells no point of the field is farther from the surface, and no point of the
  // surface above these cells farther from the field. The field may exceed the surface's border by
  // one cell.
  double deviation_m = 0.0;
};

// The lowest surface that faces up. Throws Error: no triangle faces up, or more than 2^26 nodes.
HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options);

// Returns false only if no point of the triangle is above or below a cell that is left out.
bool may_be_left_out(const HeightField& field, const TriangleMesh& mesh, const Triangle& triangle);

}  // namespace libmap
