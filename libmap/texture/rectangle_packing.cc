#include "libmap/texture/rectangle_packing.h"

#include <stb_rect_pack.h>

#include <algorithm>

#include "libmap/core/error.h"

namespace libmap {

std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size) {
  std::vector<stbrp_rect> left;
  for (std::size_t i = 0; i < rectangles.size(); ++i) {
    stbrp_rect rectangle{};
    rectangle.id = static_cast<int>(i);
    rectangle.w = rectangles[i].width;
    rectangle.h = rectangles[i].height;
    left.push_back(rectangle);
  }
  // As many as columns: then places are not rounded.
  std::vector<stbrp_node> nodes(static_cast<std::size_t>(page_size));
  std::size_t pages = 0;
  for (; !left.empty(); ++pages) {
    stbrp_context page{};
    stbrp_init_target(&page, page_size, page_size, nodes.data(), page_size);
    stbrp_pack_rects(&page, left.data(), static_cast<int>(left.size()));
    const auto packed = std::stable_partition(
        left.begin(), left.end(), [](const stbrp_rect& r) { return r.was_packed == 0; });
    if (packed == left.end()) throw Error("a rectangle is larger than its page");
    for (auto r = packed; r != left.end(); ++r) {
      PackedRectangle& rectangle = rectangles[static_cast<std::size_t>(r->id)];
      rectangle.page = pages;
      rectangle.column = r->x;
      rectangle.row = r->y;
    }
    left.erase(packed, left.end());
  }
  return pages;
}

}  // namespace libmap
