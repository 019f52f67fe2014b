// Textured meshes written to files, and the colors on them.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "libmap/texture/textured_mesh_io.h"

namespace graspmap_test {

// Writes all files of a model.
inline void write_textured_mesh(const std::filesystem::path& path,
                                const libmap::TexturedMesh& model,
                                const libmap::TexturedMeshWriteOptions& options = {}) {
  for (const libmap::ModelFile& file : libmap::textured_mesh_files(path, model, options))
    file.write(file.path);
}

inline Eigen::Vector3f texel(const libmap::ColorImage& page, int column, int row) {
  const libmap::Color& color =
      page.at(std::clamp(column, 0, page.width - 1), std::clamp(row, 0, page.height - 1));
  return Eigen::Vector3f(color[0], color[1], color[2]);
}

// The texture at (1 - u - v) * a + u * b + v * c of a triangle, 0 to 255 a channel, bilinear
// between the centers of texels. Zeros where the triangle has no page.
inline Eigen::Vector3f texture_color(const libmap::TexturedMesh& model, std::uint32_t triangle,
                                     double u, double v) {
  const std::int32_t number = model.page_of_triangle[triangle];
  if (number == libmap::no_page) return Eigen::Vector3f::Zero();
  const libmap::ColorImage& page = model.pages[static_cast<std::size_t>(number)];
  const libmap::TextureCorners& corners = model.texture_coordinates[triangle];
  const Eigen::Vector2d place = (1.0 - u - v) * corners[0].cast<double>() +
                                u * corners[1].cast<double>() + v * corners[2].cast<double>();
  const double x = std::clamp(place.x(), 0.0, 1.0) * page.width - 0.5;
  const double y = std::clamp(place.y(), 0.0, 1.0) * page.height - 0.5;
  const int column = static_cast<int>(std::floor(x));
  const int row = static_cast<int>(std::floor(y));
  const auto right = static_cast<float>(x - column);
  const auto below = static_cast<float>(y - row);
  return (1.0F - below) *
             ((1.0F - right) * texel(page, column, row) + right * texel(page, column + 1, row)) +
         below * ((1.0F - right) * texel(page, column, row + 1) +
                  right * texel(page, column + 1, row + 1));
}

}  // namespace graspmap_test
