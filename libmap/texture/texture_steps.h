// Steps of texturing: subdivision of the mesh, exposure of the photographs, assignment of
// photographs to triangles, and painting of the pages. Private to libmap/texture.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/texture_atlas.h"
#include "libmap/texture/texture_photos.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

// Subdivides a mesh without changing its surface.

struct SubdivisionResult {
  TriangleMesh mesh;
  double max_side_m = 0.0;            // maximum side length that was used
  std::vector<std::uint32_t> source;  // index of the input triangle, one per triangle
};

// Returns true if a triangle with a long side must be subdivided. Called from several threads.
using NeedsCutting = std::function<bool(const TriangleMesh& mesh, const Triangle& triangle)>;

// Halves sides longer than `max_side_m`, in all adjacent triangles, until no triangle that needs
// cutting has such a side. Indices and positions of existing vertices are kept. If the result would
// exceed both `max_triangles` and twice the input's triangles, a larger side length is used. Vertex
// values are interpolated; parts of a triangle inherit the face fields.
SubdivisionResult split_long_sides(
    TriangleMesh mesh, double max_side_m, std::uint64_t max_triangles,
    const NeedsCutting& needs_cutting = [](const TriangleMesh&, const Triangle&) { return true; });

// Relative exposure of photographs and vignetting of the lens, from points in several photographs.
// Colors are divided by exposure and vignetting before they are blended.

struct TextureExposure {
  std::vector<Eigen::Vector3f> gains;  // per photograph and channel, relative to the geometric mean
  std::array<double, 3> vignetting{0, 0, 0};  // a b c; ln(brightness) = a r^2 + b r^4 + c r^6
  std::size_t observations = 0;               // number of colors used
  // Standard deviation of ln(color) of one point between photographs, before and after correction.
  double log_color_deviation_before = 0.0;
  double log_color_deviation = 0.0;

  // Divisor of the colors of `photo`, per channel; radius2 = r^2, with r = 1 at the image corners.
  Eigen::Vector3f factor(std::size_t photo, double radius2) const;
};

struct ExposureOptions {
  bool gains = true;       // estimate one gain per photograph and channel
  bool vignetting = true;  // estimate vignetting, equal in all photographs
};

// Estimates exposure by least squares over all vertices seen in several photographs (Brown and Lowe
// 2007, equation 29, in logarithms; vignetting as in Goldman and Chen 2005), with Huber weights
// against outliers. `observations` may be in any order; dark and saturated colors are ignored.
// `photos` is the number of photographs. Without observations, gains are 1 and vignetting is 0.
TextureExposure estimate_exposure(std::span<const ColorObservation> observations,
                                  std::size_t photos, const ExposureOptions& options);

// Assigns one photograph to each triangle: good views with short seams between them.
//
// The energy is that of Lempitsky and Ivanov 2007 (equation 1): the loss of view quality relative
// to each triangle's best view, plus the cost of the seams. A seam is an edge between triangles of
// different photographs. The energy is minimized by exact dynamic programming over forests of
// triangles while all other triangles keep their photographs (block coordinate descent as in
// Thuerck et al. 2016, "A Fast, Massively Parallel Solver for Large, Irregular Pairwise Markov
// Random Fields"), alternating with forests of regions of one photograph.

constexpr std::uint32_t no_photo = 0xffffffff;

struct LabelingOptions {
  // >= 0: 1 m of seam costs as much as showing this area (m2) at half of the best quality.
  double seam_cost_m = 0.1;
};

struct TextureLabels {
  std::vector<std::uint32_t> photos;  // one per triangle; no_photo if no photograph sees it
  double energy_before = 0.0;         // m2, with the best view for every triangle
  double energy = 0.0;                // m2, with `photos`
  double seams_before_m = 0.0;        // length of the seams with the best view for every triangle
  double seams_m = 0.0;               // length of the seams with `photos`
};

// Minimizes the energy. `opposite` has one entry per half-edge, `views` one row per triangle.
TextureLabels label_triangles(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                              const ViewTable& views, const LabelingOptions& options);

// Paints the pages of a texture from the photographs.

// Blending weight of a photograph at a vertex.
struct BlendingWeight {
  std::uint32_t photo = 0;
  float weight = 0.0F;
};

// Blending weights of all vertices: vertex v has weights[first[v]] to weights[first[v + 1] - 1],
// with a sum of 1. Without weights at a vertex, a triangle's own photograph is used there.
struct BlendingWeights {
  std::vector<BlendingWeight> weights;
  std::vector<std::uint32_t> first;
};

// Returns the weights of the best `views` photographs of each vertex: quality^exponent minus
// quality^exponent of the best unused photograph, normalized. The weights are continuous over the
// surface (masked photo blending, Callieri et al. 2008). Returns no weights if `views` is 1.
BlendingWeights blending_weights(const ViewTable& of_vertices, int views, double exponent);

struct TexturePaint {
  const TexturePhotos& photos;
  const TextureExposure& exposure;
  const BlendingWeights& weights;
  Color neutral{};  // color of triangles without a photograph
};

// Paints all charts of `atlas` into the pages of `model`, the result of atlas.make_model. Texels
// outside all triangles get the color of the chart's nearest triangle. Independent of thread count.
void paint_texture(const TextureAtlas& atlas, const TexturePaint& paint, TexturedMesh& model,
                   Progress& progress);

}  // namespace libmap
