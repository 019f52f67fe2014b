// Computes the colors of texture pages from photographs. Private to libmap/texture.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/texture/texture_atlas.h"
#include "libmap/texture/texture_exposure.h"
#include "libmap/texture/texture_photos.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

// Blending weight of a photograph at a vertex.
struct BlendingWeight {
  std::uint32_t photo = 0;
  float weight = 0.0F;
};

// Blending weights of all vertices: vertex v has shares[first[v]] .. [first[v + 1] - 1], which sum
// up to 1. A vertex without weights uses the photograph of the triangle.
struct BlendingWeights {
  std::vector<BlendingWeight> weights;
  std::vector<std::uint32_t> first;
};

// Returns the weights of the best `views` photographs of each vertex: quality^exponent minus that
// of the next best photograph, normalized. The weights are continuous over the surface (masked
// photo blending, Callieri et al. 2008). Returns no weights if `views` is 1.
BlendingWeights blending_weights(const ViewTable& of_vertices, int views, double exponent);

struct TexturePaint {
  const TexturePhotos& photos;
  const TextureExposure& exposure;
  const BlendingWeights& weights;
  Color neutral{};
};

// Paints all charts of `atlas` into the pages of `model`, the result of atlas.make_model. Texels
// outside all triangles get the color of the nearest triangle of the chart. Independent of the
// number of threads.
void paint_texture(const TextureAtlas& atlas, const TexturePaint& paint, TexturedMesh& model,
                   Progress& progress);

}  // namespace libmap
