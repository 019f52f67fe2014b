// Rectangles on as few pages as may be. Inner part of libmap/mesh.
#pragma once

#include <cstddef>
#include <vector>

namespace libmap {

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

}  // namespace libmap
