#include "libmap/core/textured_mesh.h"

#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

void require_one_a_triangle(const TexturedMesh& model, const char* name, std::size_t count) {
  if (count == model.mesh.triangles.size()) return;
  throw Error("not one a triangle", {.field = name,
                                     .value = std::to_string(count) + " values",
                                     .bound = std::to_string(model.mesh.triangles.size())});
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
                  {.field = "triangle " + std::to_string(t),
                   .value = std::to_string(page),
                   .bound = "0 to " + std::to_string(pages.size()) + " - 1"});
    for (const Eigen::Vector2f& corner : texture_coordinates[t])
      if (!corner.allFinite())
        throw Error("texture coordinate is not finite", {.field = "triangle " + std::to_string(t)});
  }
}

}  // namespace libmap
