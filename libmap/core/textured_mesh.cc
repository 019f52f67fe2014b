#include "libmap/core/textured_mesh.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

void require_one_a_triangle(const TexturedMesh& model, const char* name, std::size_t count) {
  if (count == model.mesh.triangles.size()) return;
  throw Error("not one a triangle", {.file = {},
                                     .field = name,
                                     .value = std::to_string(count) + " values",
                                     .bound = std::to_string(model.mesh.triangles.size())});
}

Eigen::Vector3f texel(const ColorImage& page, int column, int row) {
  const Color& color =
      page.at(std::clamp(column, 0, page.width - 1), std::clamp(row, 0, page.height - 1));
  return Eigen::Vector3f(color[0], color[1], color[2]);
}

}  // namespace

void TexturedMesh::check() const {
  mesh.check();
  require_one_a_triangle(*this, "texture_coordinates", texture_coordinates.size());
  require_one_a_triangle(*this, "page_of_triangle", page_of_triangle.size());
  for (std::size_t t = 0; t < page_of_triangle.size(); ++t) {
    const std::int32_t page = page_of_triangle[t];
    if (page != no_page && (page < 0 || static_cast<std::size_t>(page) >= pages.size()))
      throw Error("there is no such page of the texture",
                  {.file = {},
                   .field = "triangle " + std::to_string(t),
                   .value = std::to_string(page),
                   .bound = "0 to " + std::to_string(pages.size()) + " - 1"});
    for (const Eigen::Vector2f& corner : texture_coordinates[t])
      if (!corner.allFinite())
        throw Error(
            "texture coordinate is not finite",
            {.file = {}, .field = "triangle " + std::to_string(t), .value = {}, .bound = {}});
  }
}

Eigen::Vector3f texture_color(const TexturedMesh& model, std::uint32_t triangle, double u,
                              double v) {
  const std::int32_t number = model.page_of_triangle[triangle];
  if (number == no_page) return Eigen::Vector3f::Zero();
  const ColorImage& page = model.pages[static_cast<std::size_t>(number)];
  const TextureCorners& corners = model.texture_coordinates[triangle];
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

}  // namespace libmap
