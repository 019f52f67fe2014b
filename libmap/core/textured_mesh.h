// A triangle mesh with pictures on it, as plain data.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Where a triangle's corners lie on its page: from 0 to 1 over the page's width and height, from
// the top left (as in glTF; OBJ counts from the bottom). The center of texel (column, row) lies at
// ((column + 0.5) / width, (row + 0.5) / height).
using TextureCorners = std::array<Eigen::Vector2f, 3>;

// A triangle without texture.
constexpr std::int32_t no_page = -1;

// `texture_coordinates` and `page_of_triangle` are one a triangle. Corners without texture have
// the page no_page.
struct TexturedMesh {
  TriangleMesh mesh;
  std::vector<TextureCorners> texture_coordinates;
  std::vector<std::int32_t> page_of_triangle;
  std::vector<ColorImage> pages;

  bool has_texture() const { return !pages.empty(); }

  // Throws Error naming the first array of a wrong length, page out of range or coordinate that is
  // not finite; and what TriangleMesh::check throws.
  void check() const;
};

}  // namespace libmap
