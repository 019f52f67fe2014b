// Meshes the visible surface of a scene of primitive shapes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/scenes/primitive_scene.h"

namespace libmap {

struct SceneMeshOptions {
  double edge_length_m = 0.01;    // > 0: maximum edge length along grid lines; diagonals: 1.5 times
  double chord_error_m = 0.0002;  // > 0: maximum distance of triangles from round shapes, not bumps
  std::uint64_t max_triangles = 20'000'000;  // maximum number of triangles
};

// Meshes the visible surface, with the face field "shape" (index of the shape). Triangles are
// oriented outward; vertices are on the exact surface. Where solids intersect:
//   - Triangles are cut, with the new vertices on both surfaces.
//   - Solids share these vertices with the ground. If they do not touch each other, the only border
//     of the mesh is the outline of the plane.
//   - Two solids, or a solid and a second plane, share no vertices: cut edges agree only to within
//     the sag of a chord of edge_length_m, and parts thinner than edge_length_m may be missed.
//   - Where a solid crosses the ground's outline, ground triangles are kept or dropped uncut.
// Throws Error for an invalid scene, or one with about more than max_triangles.
TriangleMesh scene_mesh(const PrimitiveScene& scene, const SceneMeshOptions& options);

}  // namespace libmap
