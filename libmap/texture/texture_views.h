// Visibility of triangles and vertices in photographs, with quality. Private to libmap/texture.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/texture/texture_photos.h"

namespace libmap {

struct TextureViewOptions {
  double max_incidence_deg = 85.0;  // between the ray and the normal; > 0, < 90
  // Photographs in which a triangle's center has a larger z are not used for it. The default is the
  // maximum depth of fusion. 0: no limit.
  double max_depth_m = 4.0;
  // A surface further behind another than this is occluded. Covers errors of mesh and poses.
  double occlusion_tolerance_m = 0.01;
  int border_px = 3;  // width of the unused border of each photograph
  // Views this near to an occluder's silhouette get a low quality (pose errors, mixed pixels).
  int occlusion_margin_px = 3;
};

struct ViewQuality {
  std::uint32_t photo = 0;
  // Pixels per square meter of the surface, times factors <= 1 for slant and the photograph's
  // border, and the photograph's sharpness.
  float quality = 0.0F;
};

// The best views of each row (a triangle or a vertex), best first; ties by photograph index.
class ViewTable {
 public:
  ViewTable() = default;
  // At most `capacity` views per row.
  ViewTable(std::size_t rows, std::size_t capacity);

  std::size_t rows() const { return counts_.size(); }
  std::span<const ViewQuality> operator[](std::size_t row) const {
    return {entries_.data() + row * capacity_, counts_[row]};
  }
  // Different rows may be filled from several threads.
  void insert(std::size_t row, ViewQuality view);

 private:
  std::size_t capacity_ = 0;
  std::vector<ViewQuality> entries_;
  std::vector<std::uint16_t> counts_;
};

// Color of one vertex in one photograph.
struct ColorObservation {
  std::uint32_t vertex = 0;  // index among the observed vertices
  std::uint32_t photo = 0;
  float x = 0.0F;  // pixel
  float y = 0.0F;
  float radius2 = 0.0F;  // squared distance from the image center, 1 in the corners
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // 0 to 255
};

// Part of the mesh and number of views to find.
struct TextureViewRequest {
  // Views of the first `triangles` triangles and of the vertices of these triangles are found. The
  // other triangles are occluders, and contribute to the quality of common vertices.
  std::size_t triangles = 0;
  // Maximum number of views; both 0: no views, which takes much less time.
  std::size_t views_per_triangle = 0;
  std::size_t views_per_vertex = 0;
  std::size_t observed_vertices = 0;  // approximate number, exceeded at most twofold; 0: none
};

struct TextureViews {
  // One row per triangle: photographs that see it completely.
  ViewTable of_triangles;
  // One row per vertex up to the last one of the requested triangles: photographs that see all
  // triangles of the vertex, with the minimum quality. Empty for vertices of other triangles only.
  ViewTable of_vertices;
  // All views of a subset of vertices, spread over the requested triangles. Colors are not set yet.
  std::vector<ColorObservation> observations;
  std::size_t observed_vertices = 0;  // number of vertices in `observations`' numbering
};

// Sets radius2 and color of all observations. Decodes each photograph once.
void look_up_colors(const TexturePhotos& photos, std::vector<ColorObservation>& observations);

// Finds the views of triangles and vertices. Corners of a triangle must be inside the photograph
// and not occluded (one ray each, Embree), nor may the center be if a side is longer than 6 pixels.
// The mesh must not be empty; triangles larger than a photograph have no view. The result is the
// same for any number of threads.
TextureViews find_texture_views(const TriangleMesh& mesh, const TexturePhotos& photos,
                                const TextureViewOptions& options,
                                const TextureViewRequest& request, Progress& progress);

}  // namespace libmap
