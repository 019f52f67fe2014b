#include "libmap/texture/texture_corners.h"

#include <algorithm>

namespace libmap {

UnitedCorners unite_corners(const TexturedMesh& model) {
  UnitedCorners result;
  constexpr std::uint32_t none = 0xffffffff;
  // The corners of a vertex are a list: few have more than two.
  std::vector<std::uint32_t> newest(model.mesh.vertices.size(), none);
  std::vector<std::uint32_t> older;
  result.of_triangle.resize(model.mesh.triangles.size());
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = model.mesh.triangles[t][k];
      const Eigen::Vector2f& coordinate = model.texture_coordinates[t][k];
      std::uint32_t corner = newest[vertex];
      while (corner != none && result.corners[corner].coordinate != coordinate)
        corner = older[corner];
      if (corner == none) {
        corner = static_cast<std::uint32_t>(result.corners.size());
        result.corners.push_back({vertex, coordinate});
        older.push_back(newest[vertex]);
        newest[vertex] = corner;
      }
      result.of_triangle[t][k] = corner;
    }
  return result;
}

std::string encode_page(const ColorImage& page, const TexturedMeshWriteOptions& options) {
  return options.image_format == ImageFormat::png ? encode_png(page)
                                                  : encode_jpeg(page, options.jpeg_quality);
}

}  // namespace libmap
