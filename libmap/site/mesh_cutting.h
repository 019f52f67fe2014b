// Meshes cut along a polygon of the x-y plane and at heights.
#pragma once

#include "libmap/core/triangle_mesh.h"
#include "libmap/site/plan_polygon.h"

namespace libmap {

// The surface inside the prism. New vertices stand where the surface crosses its border, at its
// corners too; x and y of a border that runs along an axis are exact, on others within rounding. A
// vertex within 1e-7 m of the border is moved onto it, so that no slivers arise. Triangles that
// share an edge are cut at the same vertex: a mesh without T-junctions stays without. Normals,
// colors and fields of vertices are interpolated (mesh_parts.h), those of faces kept. Surfaces of
// any form will do: open, not manifold, overhanging, upright. Nothing inside: an empty mesh. Throws
// Error: arrays that do not fit, a vertex of a triangle that is not finite.
TriangleMesh cut_mesh(TriangleMesh mesh, const ExtrudedPolygon& prism);

}  // namespace libmap
