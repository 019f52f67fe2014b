// Cuts a mesh along a polygon of the x-y plane and at two heights, for cropping.
#pragma once

#include "libmap/core/triangle_mesh.h"
#include "libmap/site/xy_polygon.h"

namespace libmap {

// Returns the surface inside the prism, an empty mesh if there is none. New vertices are created
// where the surface crosses the sides and vertical edges of the prism, with exact x or y on sides
// parallel to an axis. To avoid slivers, vertices within 1e-7 m of the border are moved onto the
// border. Triangles that share an edge are cut at the same vertex, so that no T-junctions arise.
// Normals, colors and fields of vertices are interpolated (mesh_parts.h); fields of faces are kept.
// Surfaces may be open, non-manifold, overhanging or vertical. Throws Error if array sizes are
// inconsistent or a vertex of a triangle is not finite.
TriangleMesh cut_mesh(TriangleMesh mesh, const ExtrudedPolygon& prism);

}  // namespace libmap
