// Finds and fills holes of a surface.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

// Name of the face field that is 1 on triangles that fill holes, 0 on others.
inline constexpr const char* filled_field = "filled";

using BoundaryLoop = std::vector<HalfEdge>;  // closed boundary, as from boundary_loops()

// Returns the holes of an oriented manifold: boundaries with a diameter (largest distance between
// two vertices) of at most `max_hole_m`. The longest boundary of a component is the outer boundary
// and no hole, unless its radius is below half of the component's radius. Both radii are the
// largest distance of a vertex from the mean of the boundary. With `known`, the mesh is part of a
// larger mesh and complete only in this box in x and y: boundaries that extend beyond the box are
// not holes, and components that extend beyond the box have no outer boundary.
using XyBox = Eigen::AlignedBox2d;
std::vector<BoundaryLoop> find_holes(const TriangleMesh& mesh, double max_hole_m,
                                     const std::optional<XyBox>& known = std::nullopt);
// Returns for each component true if it extends beyond the box `known`; all false without a box.
std::vector<bool> components_beyond(const TriangleMesh& mesh, const MeshComponents& components,
                                    const std::optional<XyBox>& known);

// Conditions for accepting a patch.
enum class PatchCheck {
  manifold,      // the patch continues the manifold and has no degenerate triangle
  intersection,  // additionally, the patch intersects no other triangle
};

struct HoleFilling {
  std::size_t holes = 0;      // filled holes
  std::size_t unfilled = 0;   // holes for which no patch was accepted
  std::size_t triangles = 0;  // new triangles
  double area_m2 = 0.0;       // area of the new triangles
};

// Fills each hole. Tries a faired patch (continues the tangent planes around the hole), then a
// refined patch (new vertices, not faired), then a plain triangulation of the boundary. A hole
// stays open if `check` rejects all three, or its boundary has more than 5000 edges. New vertices
// and triangles are appended. Colors and fields of new vertices are interpolated from the boundary,
// weighted by the inverse squared distance; integer fields take the value of the nearest vertex.
// Face fields are copied from the triangle at the nearest boundary edge; `filled` is 1 and is
// created if missing. The mesh must be an oriented manifold. Independent of the number of threads.
HoleFilling fill_holes(TriangleMesh& mesh, const std::vector<BoundaryLoop>& holes,
                       PatchCheck check = PatchCheck::intersection,
                       Progress& progress = no_progress());

// Returns the face field `filled` of the mesh. Creates it with zeros if there is none.
ScalarField& filled_marks(TriangleMesh& mesh);

}  // namespace libmap
