// The colors of a texture's pages from the photographs. Private to libmap/texture.
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

// A photograph's share in the color of a vertex.
struct ViewShare {
  std::uint32_t photo = 0;
  float share = 0.0F;
};

// Shares of each vertex, which add up to 1: those of vertex v are shares[first[v]] ..
// [first[v + 1] - 1]; none where the vertex takes the photograph of its triangle.
struct BlendingShares {
  std::vector<ViewShare> shares;
  std::vector<std::uint32_t> first;
};

// The `views` best of each vertex by their quality to the power of `exponent`, less that of the
// next best: shares change without a jump from vertex to vertex (masked photo blending, Callieri et
// al. 2008). `views` of 1 gives no shares at all.
BlendingShares share_views(const ViewTable& of_vertices, int views, double exponent);

struct TexturePaint {
  const TexturePhotos& photos;
  const TextureExposure& exposure;
  const BlendingShares& shares;
  Color neutral{};
};

// Paints all charts of `atlas` into the pages of `model`, which atlas.make_model has made: texels
// in triangles by where they lie on the surface, those around them as the nearest in the chart. The
// same for any number of threads.
void paint_texture(const TextureAtlas& atlas, const TexturePaint& paint, TexturedMesh& model,
                   Progress& progress);

}  // namespace libmap
