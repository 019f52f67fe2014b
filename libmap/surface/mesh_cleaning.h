// Cleans any set of triangles to an oriented manifold without degenerate, duplicate or intersecting
// triangles, without small components and holes. Optionally smooths and decimates the mesh.
//
// Steps; each keeps the order of vertices and triangles:
//  1. drop unused vertices; merge vertices within a tolerance into the first one; drop duplicate
//     triangles and triangles without area
//  2. cut at edges of more than two triangles, at vertices of more than one fan of triangles and
//     where no consistent orientation exists; keep the orientation of most of the area
//     (make_manifold); remove caps (triangles with a corner on the opposite edge; flip_caps)
//  3. drop islands (components with a small area)
//  4. remove intersecting or degenerate triangles with the triangles around them; close these holes
//     if possible (self_intersections, hole_filling)
//  5. fill holes (hole_filling)
//  6. smooth, decimate, then step 4 again
//  7. drop islands again, estimate vertex normals
#pragma once

#include <cstddef>
#include <optional>

#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/surface/hole_filling.h"

namespace libmap {

struct MeshCleaningOptions {
  bool repair = true;  // steps 1, 2 and 4
  // >= 0: vertices within this distance are merged; 0: 1e-7 of the diagonal of the bounding box.
  double merge_distance_m = 0.0;
  double min_island_area_m2 = 0.01;  // >= 0: components with a smaller area are dropped
  double min_island_fraction = 0.0;  // 0 to 1: minimum area relative to the largest component
  // >= 0: maximum diameter (largest distance between two boundary vertices) of filled holes. The
  // longest boundary of a component is not filled, unless its radius is less than half of the
  // component's radius, as of a hole in a ball (find_holes).
  double max_hole_m = 0.1;
  int smoothing_iterations = 0;  // >= 0: number of iterations of Taubin's smoothing
  // >= 0: maximum distance between the decimated and the original surface; 0: no decimation.
  double decimation_error_m = 0.0;
  // Box in x and y beyond which the mesh may continue; nullopt: the mesh is complete. Components
  // that extend beyond the box are no islands, boundaries that extend beyond it no holes.
  std::optional<XyBox> known = std::nullopt;
};
void bind(ParameterTable& table, MeshCleaningOptions& options);

struct MeshDecimation {
  std::size_t removed_triangles = 0;  // difference of the numbers of triangles
  // Proved bound of the distance between both surfaces, <= decimation_error_m.
  double deviation_m = 0.0;
};

struct MeshCleaningResult {
  // Has unit vertex normals and the face field `filled` (uint8), 1 on triangles that fill holes.
  // Colors and fields are kept; new vertices take colors and fields from the hole's boundary.
  TriangleMesh mesh;

  std::size_t merged_vertices = 0;       // replaced by an earlier vertex
  std::size_t unused_vertices = 0;       // vertices of no triangle, dropped
  std::size_t degenerate_triangles = 0;  // removed, without area
  std::size_t duplicate_triangles = 0;   // removed
  std::size_t cut_edges = 0;             // edges cut in step 2
  std::size_t split_vertices = 0;        // new copies of vertices with several fans of triangles
  std::size_t turned_triangles = 0;      // triangles whose orientation was reversed
  std::size_t islands = 0;               // dropped components
  double island_area_m2 = 0.0;           // area of the dropped components
  // Triangles removed in step 4, without the triangles around them.
  std::size_t intersecting_triangles = 0;
  std::size_t closing_triangles = 0;  // new triangles in holes that step 4 made
  std::size_t unclosed_holes = 0;     // holes that step 4 made and that stay open
  std::size_t remaining_intersecting_triangles =
      0;                // triangles that still intersect; 0 without repair
  HoleFilling filling;  // holes filled in step 5
  MeshDecimation decimation;
  StageTimings timings_s;
};
void describe(ResultTable& table, const MeshCleaningResult& result);

// Cleans a mesh. A clean mesh is returned unchanged except for `filled` and normals. The result
// does not depend on the number of threads. Throws Error if an option or an index is out of range,
// array sizes differ, a vertex is not finite, `mesh` or (without `known`) the result has no
// triangle, or a mesh to be filled or decimated without `repair` is no oriented manifold.
MeshCleaningResult clean_mesh(const TriangleMesh& mesh, const MeshCleaningOptions& options = {},
                              Progress& progress = no_progress());

// Collapses edges into one of the two ends by quadric error (OpenMesh). Removed vertices stay
// within a tolerance of the replacing triangles, normals turn by at most 30 degrees, and needles
// are avoided. Then max_error_m is proved to bound the distance between both surfaces: triangles of
// each surface are divided until all corners of a part, and so by convexity the part, are within
// max_error_m of one triangle of the other surface. Vertices of triangles that fail are locked, and
// decimation is repeated; late attempts have a smaller tolerance. If all attempts fail, the mesh is
// unchanged. Remaining vertices and triangles keep values and order. Requires an oriented manifold.
MeshDecimation decimate_mesh(TriangleMesh& mesh, double max_error_m,
                             Progress& progress = no_progress());

// As decimate_mesh, but in one round and a quarter of the time: original triangles replace
// triangles that exceed the bound, and overlap their neighbors. The result is not a manifold.
MeshDecimation decimate_triangles(TriangleMesh& mesh, double max_error_m);

}  // namespace libmap
