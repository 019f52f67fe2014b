// Makes solids, which are closed triangle surfaces, and combines them, for building test sites.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A closed surface without self-intersections, oriented outward, of one or several parts. Each
// triangle has a label; all operations preserve the labels.
struct Solid {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<int> labels;
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

// Heights z(x, y) on a grid, row by row, x fastest. x and y range from -size/2 to size/2.
struct HeightGrid {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  std::size_t columns = 0;  // number of points along x
  std::size_t rows = 0;     // number of points along y
  std::vector<double> heights_m;
  Eigen::Vector2d at(std::size_t column, std::size_t row) const;  // x and y of a grid point
};
// Makes a block below a height grid with a flat base at base_m; label 0 on top, -1 elsewhere.
Solid block_solid(const HeightGrid& top, double base_m);

// Removes vertices that no triangle uses; the others are in the order of first use.
void drop_unused_vertices(std::vector<Eigen::Vector3d>& vertices, std::vector<Triangle>& triangles);

// Sorts vertices by x, y, z and triangles by vertex indices. The order of CGAL's results depends on
// memory addresses; after sorting, equal input gives equal bytes.
Solid sort_solid(const Solid& solid);

// Remeshes each flat region of one label with edges of about `edge_length_m`. The outlines of the
// regions do not change. Throws Error if corners coincide because a region is not flat.
Solid refine_facets(const Solid& solid, double edge_length_m);

// Union and difference of solids in general position (CGAL's corefinement, exact predicates). A
// union's edges shorter than `min_edge_m` are collapsed unless that turns a triangle by more than
// 30 degrees or makes the surface non-manifold. Throw Error if the result is not a manifold.
Solid unite(const std::vector<Solid>& solids, double min_edge_m = 0.0);
Solid subtract(const Solid& solid, const Solid& removed);

}  // namespace libmap
