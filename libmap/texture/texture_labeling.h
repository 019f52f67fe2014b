// Selects the photograph that textures each triangle of a mesh, such that views are good and seams
// between photographs short. Private to libmap/texture.
//
// The energy is that of Lempitsky and Ivanov 2007 (equation 1): the loss of view quality against
// the best view of each triangle, plus the length of the seams. The energy is minimized by exact
// dynamic programming over forests of triangles, alternating with forests of regions of one
// photograph, while all other photographs are fixed (block coordinate descent as in Thuerck et al.
// 2016, "A Fast, Massively Parallel Solver for Large, Irregular Pairwise Markov Random Fields").
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

constexpr std::uint32_t no_photo = 0xffffffff;

struct LabelingOptions {
  // Cost of a seam of 1 m: equal to the cost of this area (m2) at half the best quality.
  double seam_cost_m = 0.1;
};

struct TextureLabels {
  std::vector<std::uint32_t> photos;  // one per triangle; no_photo if no photograph sees it
  double energy_before = 0.0;         // m2, with the best view for every triangle
  double energy = 0.0;
  double seams_before_m = 0.0;  // length of edges between triangles of different photographs
  double seams_m = 0.0;
};

// Minimizes the energy. `opposite` is one per half-edge (mesh_adjacency), `views` one row per
// triangle.
TextureLabels label_triangles(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                              const ViewTable& views, const LabelingOptions& options);

}  // namespace libmap
