// Packs the charts of a mesh onto texture pages. Private to libmap/texture.
//
// A chart is a connected set of triangles with texture from one photograph. Chart positions are
// scaled and shifted pixel positions of the photograph; at scale 1, a texel is a pixel.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/texture/texture_photos.h"

namespace libmap {

struct TextureAtlasOptions {
  int texture_size = 4096;        // 64 to 16384: maximum width and height of a page, pixels
  double texel_size_m = 0.0;      // >= 0: side of a texel on the surface; 0: from texels_per_pixel
  double texels_per_pixel = 1.5;  // 0.05 to 8: texels per photograph pixel, along one side
  // >= 0: charts are scaled down to fit this number of pages, unless padding needs more; 0: never.
  int max_pages = 64;
  int padding_px = 3;  // 1 to 64: width of the extrapolated border of each chart, texels
};

// A rectangle of a page that contains the colors of connected triangles.
struct TextureChart {
  std::vector<std::uint32_t> triangles;              // ascending
  double scale = 1.0;                                // texels per pixel of the photograph
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // photograph pixel of texel (0, 0)
  std::uint32_t photo = 0;                           // index of the photograph
  std::int32_t page = 0;                             // index of the page
  int column = 0;  // column and row of the top left texel on the page, padding included
  int row = 0;
  int width = 0;  // texels, padding included
  int height = 0;
};

struct PageSize {
  int width = 0;
  int height = 0;
};

struct TextureAtlas {
  std::vector<TextureChart> charts;
  std::vector<PageSize> pages;  // cropped to the used area
  // Square of one color for triangles without a photograph, neutral_size texels wide; 0: no square.
  std::int32_t neutral_page = 0;
  Eigen::Vector2i neutral_corner = Eigen::Vector2i::Zero();
  int neutral_size = 0;
  double scale = 1.0;             // common factor of all charts; below 1 if reduced for max_pages
  std::size_t split_charts = 0;   // charts that were split because they exceeded a page
  std::size_t shrunk_charts = 0;  // single triangles larger than a page that were scaled down

  // Returns `mesh` with black pages, and with texture coordinates and page of each triangle.
  TexturedMesh make_model(const TriangleMesh& mesh, const TexturePhotos& photos) const;
};

// Builds and packs the charts. `label` has one photograph index per triangle, or no_photo;
// `opposite`: see mesh_adjacency.h. Charts that do not fit a page are split or scaled down.
TextureAtlas make_texture_atlas(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                                const std::vector<std::uint32_t>& label,
                                const TexturePhotos& photos, const TextureAtlasOptions& options);

struct PackedRectangle {
  int width = 0;
  int height = 0;
  // Set by pack_rectangles.
  std::size_t page = 0;
  int column = 0;
  int row = 0;
};

// Packs rectangles onto square pages of side `page_size`, page by page (skyline, bottom left:
// stb_rect_pack). Returns the number of pages. Throws Error if a rectangle exceeds a page.
std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size);

// Returns the texel of a world point on the chart's page; (0, 0) is the center of the first texel.
Eigen::Vector2d texel_of(const TextureChart& chart, const PhotoProjector& projector,
                         const Eigen::Vector3d& point);

}  // namespace libmap
