// Covers a surface from behind with balls, for simulators that collide meshes as convex hulls.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct CollisionBall {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // m, in the frame of the mesh
  double radius_m = 0.0;
};

struct CollisionBallOptions {
  double max_radius_m = 0.05;      // > 0: maximum radius, before max_deviation_m is added to it
  double max_deviation_m = 0.002;  // > 0: maximum distance between surface and balls
};

// Covers the triangles that are true in `marks` with balls inside the solid with the surface
// `body`, in the order of the triangles. No point of these triangles is farther than
// max_deviation_m from a ball, and no point of a ball is more than max_deviation_m outside the
// body. Triangles without area get no balls. Coordinates and radii are multiples of 10 micrometers.
std::vector<CollisionBall> cover_with_balls(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks,
                                            const TriangleMesh& body,
                                            const CollisionBallOptions& options);

}  // namespace libmap
