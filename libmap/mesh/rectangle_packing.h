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

// Places each rectangle where its top is nearest to the page's (skyline, bottom left: Jylanki 2010,
// "A Thousand Ways to Pack the Bin", section 4), the highest first, on the first page with room.
// Pages are squares of `page_size`, and no rectangle may be larger. Returns the number of pages.
std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size);

}  // namespace libmap
