// Convex pieces behind a surface, for simulators that collide meshes only by convex hulls.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// The hull of one triangle, or of several neighbors with a nearly flat convex outline, and a corner
// behind the center of the triangles.
struct ConvexPiece {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> corners_m;  // from `center`; the last one is behind the surface
};

struct ConvexPieces {
  std::vector<ConvexPiece> pieces;
  // No point of the marked triangles is outside the pieces, and no point of a piece's outer faces
  // is farther from the piece's triangles than this.
  double deviation_m = 0.0;
};

// Pieces behind the marked triangles, in the order of triangles. The depth of a piece is at most
// `max_depth_m`, half the thickness of the body behind it, and 1.5 times the radius of the smallest
// inscribed circle of the piece's triangles, so that no piece passes through an edge of more than
// 57 degrees. Triangles lower than 10 micrometers have no piece. The mesh must be an oriented
// manifold.
ConvexPieces make_convex_pieces(const TriangleMesh& mesh, const std::vector<bool>& marks,
                                const TriangleMesh& body, double body_error_m,
                                double max_deviation_m, double max_depth_m);

}  // namespace libmap
