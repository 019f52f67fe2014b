// Closed surfaces of triangles from which sites are built.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A closed surface without self-intersections, oriented outward, that may have several parts. Each
// triangle has a label, which every operation here hands on.
struct Solid {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<int> labels;
};

// The points with normal . p <= offset_m; `normal` is of unit length.
struct HalfSpace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset_m = 0.0;
};

// What the half-spaces have in common, labeled by the half-space in which a face lies. Throws
// Error if that is empty or reaches farther than `bound_m` from the origin along an axis.
Solid convex_solid(const std::vector<HalfSpace>& half_spaces, double bound_m);

// An ellipsoid about the origin, its edges about `edge_length_m` long, with label 0.
Solid ellipsoid_solid(const Eigen::Vector3d& radii_m, double edge_length_m);

// Ground: a block under the heights z(x, y) of a grid. Heights go row by row, x fastest; x and y
// run from -size/2 to size/2; the base is flat, at z = base_m. Label 0 on top, -1 below.
struct HeightGrid {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  std::size_t columns = 0;  // of points
  std::size_t rows = 0;
  std::vector<double> heights_m;
  Eigen::Vector2d at(std::size_t column, std::size_t row) const;  // x and y of a grid point
};
Solid block_solid(const HeightGrid& top, double base_m);

// Leaves the vertices that the triangles use, in the order of their first use.
void drop_unused_vertices(std::vector<Eigen::Vector3d>& vertices, std::vector<Triangle>& triangles);

// The same surface in an order that follows from its geometry alone: vertices by x, y, z, triangles
// by their vertices. CGAL goes through triangulations in the order of addresses in memory; what
// leaves it is put in this order, so that equal input gives equal bytes.
Solid in_order(const Solid& solid);

// The same surface with each flat region of one label cut into even triangles; regions keep their
// outline, and their edges stay where they are.
Solid refine_facets(const Solid& solid, double edge_length_m);

// Unions and differences of solids in general position (CGAL's corefinement with exact
// predicates). Throws Error if the result is no manifold.
// Without the splinters that cuts leave: edges shorter than `min_edge_m` are collapsed where the
// surface stays a manifold and no triangle turns over.
Solid unite(const std::vector<Solid>& solids, double min_edge_m = 0.0);
Solid subtract(const Solid& solid, const Solid& removed);

}  // namespace libmap
