// The Delaunay triangulation of a terrain's points in the plane; for interpolation.cc alone.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libgtd {

struct PlanarTriangulation {
  // Positions in the list of points, counterclockwise, the corner of least x (then y) first.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::size_t vertices = 0;
};

// Of the points' x and y; of points that share both, one of greatest z is a corner. Which triangles
// there are does not depend on the points' order or on `points_a_strip`, not even where four lie on
// one circle: CGAL decides those by a symbolic perturbation of the points. No triangles if all
// points lie on a line. Strips of about so many points are triangulated in parallel: triangles
// whose circumcircle stays within its strip are final, and what is left between them is
// triangulated once more.
PlanarTriangulation triangulate_in_plane(const std::vector<Eigen::Vector3d>& points,
                                         std::size_t points_a_strip = 16384);

}  // namespace libgtd
