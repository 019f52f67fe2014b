// Delaunay triangulation of a terrain's points in the x-y plane. Used only by interpolation.cc.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libgtd {

struct PlanarTriangulation {
  // Indices of points, counterclockwise, starting at the corner of minimum x (then y).
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::size_t vertices = 0;
};

// Triangulates the x and y of the points. Of points with the same x and y, one of maximum z is a
// vertex. Returns no triangles if the points are collinear. The set of triangles does not depend on
// the order of the points, even if four points are cocircular (symbolic perturbation of CGAL).
PlanarTriangulation triangulate_in_plane(const std::vector<Eigen::Vector3d>& points);

}  // namespace libgtd
