// Convex pieces behind a surface, for simulators that collide meshes only by their convex hulls.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A tetrahedron: the triangle itself, and a corner behind its center.
struct ConvexPiece {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // of the triangle
  std::array<Eigen::Vector3d, 4> corners_m;          // from `center`; the last one is behind
};

// One piece for each marked triangle, in their order. The depth of a piece is at most
// `max_depth_m`, half the thickness of the body behind the triangle, and 1.5 times the radius of
// the triangle's inscribed circle, so that no piece passes through an edge of more than 57 degrees.
// Triangles lower than 10 micrometers have no piece.
std::vector<ConvexPiece> make_convex_pieces(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks, double max_depth_m);

}  // namespace libmap
