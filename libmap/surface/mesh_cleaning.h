// From any triangles to a clean surface: an oriented manifold without degenerate, doubled or
// intersecting triangles, without fragments, small holes closed; smoothed and decimated if wanted.
//
// The steps, in this order; each keeps the order of what it keeps:
//  1. vertices nearer than a tolerance are made one (the first); triangles without area and
//     repeated ones are dropped, caps (a corner on the opposite edge) by flipping that edge
//  2. cutting at edges of more than two triangles, at vertices of more than one fan and where no
//     consistent orientation exists (make_manifold); orientation as most of the area has it
//  3. islands dropped
//  4. triangles that intersect others are removed with those around them, and the place closed
//     again (self_intersections, hole_filling); what cannot be closed stays open
//  5. holes filled (hole_filling)
//  6. smoothing, decimation, then step 4 again
//  7. islands dropped again, unused vertices dropped, vertex normals estimated
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
  // >= 0: vertices this near are one; 0: 1e-7 of the diagonal of the mesh's bounding box.
  double merge_distance_m = 0.0;
  double min_island_area_m2 = 0.01;  // >= 0: smaller components are dropped
  double min_island_share = 0.0;     // 0 to 1: so are those smaller than this share of the largest
  // >= 0: holes are filled whose diameter (the largest distance between two vertices of the
  // boundary) is not larger. The longest boundary of a component is its outer one and never
  // filled, unless it reaches less than half as far as the component does (the hole of a ball).
  double max_hole_m = 0.1;
  int smoothing_iterations = 0;  // >= 0
  // >= 0: no point of the decimated surface lies farther from the surface before, nor a vertex of
  // that one from the decimated surface; 0: no decimation.
  double decimation_error_m = 0.0;
  // The mesh goes on beyond, in x and y: what reaches there is no island and no hole.
  std::optional<PlanBox> known = std::nullopt;
};
void bind(ParameterTable& table, MeshCleaningOptions& options);

struct MeshDecimation {
  std::size_t removed_triangles = 0;
  // No point of either surface is farther than this from the other; not above the bound asked for.
  double deviation_m = 0.0;
};

struct MeshCleaningResult {
  // With unit vertex normals and the face field `filled` (uint8): 1 on triangles that close holes.
  // Colors and fields are those of the input; new vertices take them from the hole's boundary.
  TriangleMesh mesh;

  std::size_t merged_vertices = 0;
  std::size_t unused_vertices = 0;
  std::size_t degenerate_triangles = 0;
  std::size_t duplicate_triangles = 0;
  std::size_t cut_edges = 0;       // non-manifold, or without a consistent orientation
  std::size_t split_vertices = 0;  // copies made of vertices so that each has one fan
  std::size_t turned_triangles = 0;
  std::size_t islands = 0;
  double island_area_m2 = 0.0;
  // Removed since they met others (or stayed degenerate), without those around them.
  std::size_t intersecting_triangles = 0;
  std::size_t closing_triangles = 0;  // put there to close these places again
  std::size_t open_places = 0;        // boundaries that are left of them
  std::size_t remaining_intersecting_triangles = 0;
  HoleFilling filling;        // of step 5
  MeshDecimation decimation;  // its deviation is proved
  StageTimings timings_s;
};
void describe(ResultTable& table, const MeshCleaningResult& result);

// The same bytes for any number of threads. A mesh that is clean comes back as it was but for
// `filled` and normals. Throws Error: an option outside its range, arrays that do not fit, an index
// out of range, a vertex that is not finite, no triangle to begin with or none left.
MeshCleaningResult clean_mesh(const TriangleMesh& mesh, const MeshCleaningOptions& options = {},
                              Progress& progress = no_progress());

// Edges are collapsed into one of their ends (OpenMesh: quadric error first; no removed vertex
// farther than a tolerance from the triangles that replace its own; no normal turned by more than
// 30 degrees; no needles). Then the distance of the surfaces is bounded both ways:
// triangles are divided until all corners of a part lie within the bound of one and the same
// triangle, which is convex, so that all points between them do, too. Where it exceeds
// `max_error_m`, the vertices there are locked and all is done again, later with a smaller
// tolerance, too; if no attempt succeeds the mesh stays as it was.
// Vertices and triangles that stay keep their values and their order. The mesh must be an oriented
// manifold.
MeshDecimation decimate_mesh(TriangleMesh& mesh, double max_error_m,
                             Progress& progress = no_progress());

// The same bound after one round: places that exceed it get the original triangles back, which
// overlap those around them. A quarter of the time; the result is no manifold. For collision.
MeshDecimation decimate_triangles(TriangleMesh& mesh, double max_error_m);

}  // namespace libmap
