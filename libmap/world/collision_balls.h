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

// Returns balls that cover the triangles of `mesh` whose entry in `marks` is true, in the order of
// the triangles, which are within max_deviation_m of the balls. No ball extends more than
// max_deviation_m out of the solid with the surface `body`. Triangles without area get no balls.
// Coordinates and radii are multiples of 10 micrometers.
std::vector<CollisionBall> cover_with_balls(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks,
                                            const TriangleMesh& body,
                                            const CollisionBallOptions& options);

}  // namespace libmap
