// Makes and combines solids (closed triangle surfaces) for building test sites.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A closed surface without self-intersections, oriented outward, of one or several components. All
// operations preserve the labels.
struct Solid {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<int> labels;  // one per triangle
};

// A half-space: the points p with normal . p <= offset_m; `normal` is of unit length.
struct HalfSpace {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset_m = 0.0;
};

// Intersects half-spaces; the label of a triangle is the index of its half-space. Throws Error if
// the result is empty, degenerate or extends more than `bound_m` from the origin along an axis.
Solid convex_solid(const std::vector<HalfSpace>& half_spaces, double bound_m);

// Makes an ellipsoid around the origin with edges of about `edge_length_m` and label 0.
Solid ellipsoid_solid(const Eigen::Vector3d& radii_m, double edge_length_m);

// Heights z (m) on a grid of points in x, y from -size/2 to size/2, row by row along x.
struct HeightGrid {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  std::size_t columns = 0;  // number of points along x
  std::size_t rows = 0;     // number of points along y
  std::vector<double> heights_m;
  Eigen::Vector2d at(std::size_t column, std::size_t row) const;  // x and y of a grid point
};
// Returns a block below a height grid with a flat base at z = base_m; labels: 0 on top, else -1.
Solid block_solid(const HeightGrid& top, double base_m);

// Removes vertices that no triangle uses. The other vertices are ordered by their first use.
void drop_unused_vertices(std::vector<Eigen::Vector3d>& vertices, std::vector<Triangle>& triangles);

// Sorts vertices by x, y, z and triangles by vertex indices. The order of CGAL's results depends on
// memory addresses; after sorting, equal input gives equal bytes.
Solid sort_solid(const Solid& solid);

// Remeshes each flat region of equal label with edges of about `edge_length_m`. Outlines of regions
// do not change. Throws Error if corners coincide because a region is not flat.
Solid refine_facets(const Solid& solid, double edge_length_m);

// Return the union and difference of solids in general position (CGAL's corefinement, exact
// predicates). A union's edges below `min_edge_m` are collapsed, except where a triangle turns by
// more than 30 degrees or the surface becomes non-manifold. Throw Error for a non-manifold result.
Solid unite(const std::vector<Solid>& solids, double min_edge_m = 0.0);
Solid subtract(const Solid& solid, const Solid& removed);

}  // namespace libmap
