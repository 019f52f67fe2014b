// Surfaces over holes (CGAL). Inner part of hole_filling.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// The surface that closes a hole.
enum class PatchShape {
  faired,        // as smooth as the surface around it: tangent planes continued (C1)
  refined,       // triangles as large as those around the hole
  triangulated,  // no new vertices
};

// Indices below `vertices` of the mesh that was given are its own; the others are those of
// `new_vertices` behind them.
struct HolePatch {
  std::vector<Eigen::Vector3d> new_vertices;
  std::vector<Triangle> triangles;  // empty: none was found
};

// Triangulates the boundary (Liepa 2003, "Filling holes in meshes"; over a Delaunay triangulation
// where that holds a solution), refines and fairs it. `surroundings` are the triangles near the
// hole, an oriented manifold; the half-edge from `from` to `to` is one of the hole's. Never throws
// for geometry that cannot be filled.
HolePatch patch_hole(const std::vector<Eigen::Vector3d>& vertices,
                     const std::vector<Triangle>& surroundings, std::uint32_t from,
                     std::uint32_t to, PatchShape shape);

}  // namespace libmap
