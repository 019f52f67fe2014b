// One photograph for each triangle, so that photographs are good and seams between them are few.
// Private to libmap/texture.
//
// The energy is that of Lempitsky and Ivanov 2007 (equation 1): what a triangle's view lacks
// against its best one, plus the length of the seams. It is lowered by exact dynamic programming
// over forests of triangles, one after another, while the triangles outside keep their labels
// (block coordinate descent as in Thuerck et al. 2016, "A Fast, Massively Parallel Solver for
// Large, Irregular Pairwise Markov Random Fields"), and in turn over forests of whole regions of
// one photograph. Every step lowers the energy or keeps it.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

constexpr std::uint32_t no_photo = 0xffffffff;

struct LabelingOptions {
  // A seam of 1 m costs as much as this times 1 m2 of triangles with views of half the best
  // quality.
  double seam_cost_m = 0.1;
};

struct TextureLabels {
  std::vector<std::uint32_t> photos;  // one a triangle; no_photo where none sees it
  double energy_before = 0.0;         // m2, with the best view for every triangle
  double energy = 0.0;
  double seams_before_m = 0.0;  // between triangles of different photographs
  double seams_m = 0.0;
};

// `opposite` is one a half-edge (mesh_adjacency).
TextureLabels label_triangles(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                              const ViewTable& views, const LabelingOptions& options);

}  // namespace libmap
