// Covers a surface from behind with spheres (balls), for simulators that collide only convex hulls.
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
  double max_radius_m = 0.05;      // > 0: maximum radius, without max_deviation_m, which is added
  double max_deviation_m = 0.002;  // > 0: maximum distance between balls and surface
};

// Covers the marked triangles with balls inside of `body`, in the order of the triangles; `marks`
// has one entry per triangle. No point of a marked triangle is farther than `max_deviation_m` from
// a ball, and no point of a ball is more than `max_deviation_m` outside the body. Triangles without
// area get no balls. Coordinates and radii are whole multiples of 10 micrometers.
std::vector<CollisionBall> cover_with_balls(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks,
                                            const TriangleMesh& body,
                                            const CollisionBallOptions& options);

}  // namespace libmap
