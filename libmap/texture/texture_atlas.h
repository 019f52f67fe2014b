// Charts of a mesh on the pages of a texture. Private to libmap/texture.
//
// A chart is a connected set of triangles that one photograph shows; its shape is that of its
// picture there, whole pixels apart, so that at a scale of 1 its texels are the photograph's
// pixels.
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
  int texture_size = 4096;        // pixels, 64 to 16384: no page is wider or higher
  double texel_size_m = 0.0;      // 0: by texels_per_pixel
  double texels_per_pixel = 1.5;  // along a side of a photograph's pixel
  // More are made only where the padding around the charts alone needs them; charts are scaled down
  // before. 0: any number.
  int max_pages = 64;
  int padding_px = 3;  // texels around each chart that continue its colors; 1 to 64
};

// A place of a page with the colors of some triangles.
struct TextureChart {
  std::vector<std::uint32_t> triangles;              // ascending
  double scale = 1.0;                                // texels per pixel of the photograph
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // pixel of the photograph at texel (0, 0)
  std::uint32_t photo = 0;
  std::int32_t page = 0;
  int column = 0;  // of its top left texel, padding included
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
  std::vector<PageSize> pages;  // cut to what is used
  // A square of neutral_size texels of one color, for triangles that no photograph shows.
  std::int32_t neutral_page = 0;
  Eigen::Vector2i neutral_corner = Eigen::Vector2i::Zero();
  int neutral_size = 0;
  double scale = 1.0;             // of all charts, where they had to be made smaller for max_pages
  std::size_t split_charts = 0;   // that were cut because they were larger than a page
  std::size_t shrunk_charts = 0;  // of one triangle larger than a page: made smaller

  // Pages, texture coordinates and page of each triangle. Pages are black.
  TexturedMesh make_model(const TriangleMesh& mesh, const TexturePhotos& photos) const;
};

// `label` is one photograph per triangle, or no_photo. Never fails for want of room.
TextureAtlas make_texture_atlas(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                                const std::vector<std::uint32_t>& label,
                                const TexturePhotos& photos, const TextureAtlasOptions& options);

struct PackedRectangle {
  int width = 0;
  int height = 0;
  // Results.
  std::size_t page = 0;
  int column = 0;
  int row = 0;
};

// Fills one page after the other (skyline, bottom left: stb_rect_pack). Pages are squares of
// `page_size`. Returns the number of pages. Throws Error if a rectangle is larger than a page.
std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size);

// Where a point lies on its chart's page: texels, (0, 0) the center of the page's first.
Eigen::Vector2d place_on_page(const TextureChart& chart, const PhotoProjector& projector,
                              const Eigen::Vector3d& point);

}  // namespace libmap
