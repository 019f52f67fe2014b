// Holes of a surface found and closed.
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

// The face field that is 1 on triangles that close holes, 0 on others.
inline constexpr const char* filled_field = "filled";

using BoundaryLoop = std::vector<HalfEdge>;  // as boundary_loops()

// The boundaries of an oriented manifold whose diameter (largest distance between two of their
// vertices) is at most `max_hole_m`. The longest boundary of a component is its outer one and left
// out, unless all of it is less than half as far from its middle as the farthest vertex of the
// component. The mesh goes on beyond the box `known` in x and y: what reaches beyond it is no hole,
// and a component that does has its outer boundary there.
using PlanBox = Eigen::AlignedBox2d;
std::vector<BoundaryLoop> find_holes(const TriangleMesh& mesh, double max_hole_m,
                                     const std::optional<PlanBox>& known = std::nullopt);
// Of each component, whether it reaches beyond.
std::vector<bool> components_beyond(const TriangleMesh& mesh, const MeshComponents& components,
                                    const std::optional<PlanBox>& known);

// What a patch must be to be kept.
enum class PatchCheck {
  manifold,      // patches continue the manifold and have no degenerate triangle
  intersection,  // and meet no other triangle
};

struct HoleFilling {
  std::size_t holes = 0;     // filled
  std::size_t unfilled = 0;  // no patch stood the check
  std::size_t triangles = 0;
  double area_m2 = 0.0;
};

// Adds a patch for each hole: faired; where that does not stand the check, refined; or
// else of the boundary's vertices alone. New vertices follow those of the mesh; colors and fields
// of whole or real numbers are those of the boundary, weighted by the inverse square of the
// distance (whole numbers: of the nearest). New triangles follow the others; their face fields are
// those of the triangle at the nearest edge of the boundary, and `filled`, which is made if the
// mesh has none, is 1. The mesh must be an oriented manifold. The same for any number of threads.
HoleFilling fill_holes(TriangleMesh& mesh, const std::vector<BoundaryLoop>& holes,
                       PatchCheck check = PatchCheck::intersection,
                       Progress& progress = no_progress());

// The face field `filled` of the mesh; made, with zeros, if there is none.
ScalarField& filled_marks(TriangleMesh& mesh);

}  // namespace libmap
