// The visible surface of a scene of primitive shapes as triangles.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/primitive_scene.h"

namespace libmap {

struct SceneMeshOptions {
  double edge_length_m =
      0.01;  // > 0: longest edge along a row or ring; diagonals are up to 1.5 times
  double chord_error_m = 0.0002;  // > 0: of round shapes (bent ground follows edge_length_m alone)
  std::uint64_t max_triangles = 20'000'000;  // more is an Error
};

// The visible surface as triangles oriented outward, with the face field "shape"; vertices lie on
// the exact surface. Triangles are cut where they enter another solid, with the new vertices on
// both surfaces. Solids share those vertices with the ground: the thesis's scene has no edge with
// one triangle but the outline of its plane. Where two solids, or a solid and a second plane,
// overlap each other, their cut edges agree to within the sag of a chord of edge_length_m, not by
// vertices; parts thinner than edge_length_m can be missed. Where a solid reaches over the outline
// of the ground, the ground's last triangles are kept or dropped whole.
// Throws Error: a bad scene, or too many triangles.
TriangleMesh scene_mesh(const PrimitiveScene& scene, const SceneMeshOptions& options);

}  // namespace libmap
