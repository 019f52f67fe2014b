// Finds and rates the photographs that see each triangle and vertex. Private to libmap/texture.
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
  double max_incidence_deg = 85.0;  // > 0, < 90: maximum angle between line of sight and normal
  // >= 0: a photograph is not used for triangles whose center has a larger z in its camera frame.
  // The default is the maximum depth of fusion. 0: no limit.
  double max_depth_m = 4.0;
  // >= 0: a surface farther than this behind another is occluded. Covers errors of mesh and poses.
  double occlusion_tolerance_m = 0.01;
  int border_px = 3;  // >= 0: width of the unused border of each photograph
  // >= 0: views this near to an occluder's silhouette get low quality (pose errors, mixed pixels).
  int occlusion_margin_px = 3;
};

struct ViewQuality {
  std::uint32_t photo = 0;  // index of the photograph
  // Pixels per square meter of the surface, times the sharpness of the photograph, times factors
  // <= 1 for slant and for nearness to the photograph's border.
  float quality = 0.0F;
};

// The best views of each row (a triangle or a vertex), best first; ties by photograph index.
class ViewTable {
 public:
  ViewTable() = default;
  // Keeps at most `capacity` views per row.
  ViewTable(std::size_t rows, std::size_t capacity);

  std::size_t rows() const { return counts_.size(); }
  std::span<const ViewQuality> operator[](std::size_t row) const {
    return {entries_.data() + row * capacity_, counts_[row]};
  }
  // Adds a view, or drops it if the row is full of better views. Threads may fill different rows.
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
  float x = 0.0F;        // pixel column
  float y = 0.0F;        // pixel row
  float radius2 = 0.0F;  // squared distance from the image center, 1 in the corners
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // 0 to 255
};

// Part of the mesh and number of views to find.
struct TextureViewRequest {
  // Views of the first `triangles` triangles and of their vertices are found. The other triangles
  // are only occluders, and contribute to the quality of common vertices.
  std::size_t triangles = 0;
  // Maximum number of views; both 0: no views, which takes much less time.
  std::size_t views_per_triangle = 0;
  std::size_t views_per_vertex = 0;
  std::size_t observed_vertices = 0;  // requested number (up to twice as many are found); 0: none
};

struct TextureViews {
  // One row per triangle: photographs that see it completely.
  ViewTable of_triangles;
  // One row per vertex up to the last vertex of the requested triangles: photographs that see all
  // triangles of the vertex, (quality: that of the worst). Rows of other vertices are empty.
  ViewTable of_vertices;
  // All views of a subset of vertices, spread over the requested triangles, without colors.
  std::vector<ColorObservation> observations;
  std::size_t observed_vertices = 0;  // number of observed vertices (ColorObservation::vertex)
};

// Sets radius2 and color of all observations. Decodes each photograph once.
void look_up_colors(const TexturePhotos& photos, std::vector<ColorObservation>& observations);

// Finds the views of triangles and vertices. The corners of a triangle, and its center if a side is
// longer than 6 pixels, must be inside the photograph and not occluded (one ray each, Embree). The
// mesh must not be empty; triangles larger than a photograph have no view. The result is the same
// for any number of threads.
TextureViews find_texture_views(const TriangleMesh& mesh, const TexturePhotos& photos,
                                const TextureViewOptions& options,
                                const TextureViewRequest& request, Progress& progress);

}  // namespace libmap
