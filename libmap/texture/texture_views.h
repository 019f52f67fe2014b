// Which photographs see which parts of a mesh, and how well. Private to libmap/texture.
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
  // Photographs in which a triangle's center has a larger z are not used for it: as far as depth is
  // fused by default, so that what was measured has a photograph that is near enough. 0: any z.
  double max_depth_m = 4.0;
  // A surface is hidden that lies further behind another than this: the mesh's own error, and that
  // of the poses.
  double occlusion_tolerance_m = 0.01;
  int border_px = 3;  // of each photograph are not used
  // Where a surface is this near in the photograph to another that stands before it, the view
  // counts for little: poses are not exact, and pixels mix.
  int occlusion_margin_px = 3;
};

struct ViewQuality {
  std::uint32_t photo = 0;
  // Pixels a square meter of the surface, times what counts against the view: slant, the
  // photograph's border, blur.
  float quality = 0.0F;
};

// The best few views of each of many things, the best first; equally good ones by their photograph.
class ViewTable {
 public:
  ViewTable() = default;
  // So many things, with `capacity` views each at most.
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

// What one photograph shows at one vertex.
struct ColorObservation {
  std::uint32_t vertex = 0;  // of those that are observed
  std::uint32_t photo = 0;
  float x = 0.0F;  // of its pixel
  float y = 0.0F;
  float radius2 = 0.0F;  // squared distance from the image's middle, 1 in its corners
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // 0 to 255
};

// What is asked for of a mesh, and of which part.
struct TextureViewRequest {
  // The first so many triangles and their vertices. The others may hide them, and decide with them
  // how well their common vertices are seen.
  std::size_t triangles = 0;
  // 0 both: none, which takes much less time.
  std::size_t views_a_triangle = 0;
  std::size_t views_a_vertex = 0;
  std::size_t observed_vertices = 0;  // about so many, at most twice as many
};

struct TextureViews {
  // Of triangles that a photograph sees whole.
  ViewTable of_triangles;
  // Of vertices of which a photograph sees all triangles whole: the least of their qualities. One
  // row for each vertex up to the last one of the part, empty for those of other triangles alone.
  ViewTable of_vertices;
  // All views of some of the vertices, spread over the part; colors are not looked up yet.
  std::vector<ColorObservation> observations;
  std::size_t observed_vertices = 0;
};

// Sets radius2 and color of all observations. Decodes each photograph once.
void look_up_colors(const TexturePhotos& photos, std::vector<ColorObservation>& observations);

// Corners and center of a triangle must be in the photograph and not be hidden (one ray each,
// Embree). The same for any number of threads. The mesh must have a triangle, and no triangle large
// against a photograph: it would be seen whole by none.
TextureViews find_texture_views(const TriangleMesh& mesh, const TexturePhotos& photos,
                                const TextureViewOptions& options,
                                const TextureViewRequest& request, Progress& progress);

}  // namespace libmap
