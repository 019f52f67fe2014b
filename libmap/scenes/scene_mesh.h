// Meshes the visible surface of a scene of primitive shapes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/primitive_scene.h"

namespace libmap {

struct SceneMeshOptions {
  double edge_length_m = 0.01;    // > 0: maximum edge along rows and rings; diagonals: 1.5 times
  double chord_error_m = 0.0002;  // > 0: maximum distance from round shapes; not for bumps
  std::uint64_t max_triangles = 20'000'000;
};

// Meshes the visible surface with the face field "shape". Triangles are oriented outward; vertices
// are on the exact surface. Triangles that intersect another solid are cut, with the new vertices
// on both surfaces. Solids share these vertices with the ground; if they do not touch each other,
// the only border is the outline of the plane. Where two solids, or a solid and a second plane,
// overlap, cut edges agree to within the sag of a chord of edge_length_m but share no vertices;
// parts thinner than edge_length_m may be missed. Where a solid extends beyond the outline of the
// ground, border triangles of the ground are kept or dropped as a whole. Throws Error for an
// invalid scene, or one with about more than max_triangles.
TriangleMesh scene_mesh(const PrimitiveScene& scene, const SceneMeshOptions& options);

}  // namespace libmap
