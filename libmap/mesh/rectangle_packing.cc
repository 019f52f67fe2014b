#include "libmap/mesh/rectangle_packing.h"

#include <algorithm>
#include <numeric>
#include <optional>

namespace libmap {

namespace {

// Rows from the top are taken up to `level` over columns `column` to `column + width - 1`.
struct Step {
  int column = 0;
  int width = 0;
  int level = 0;
};

struct Place {
  std::size_t step = 0;
  int level = 0;
};

class Skyline {
 public:
  explicit Skyline(int size) : size_(size), steps_{{0, size, 0}} {}

  std::optional<Place> find(int width, int height) const {
    std::optional<Place> best;
    for (std::size_t i = 0; i < steps_.size() && steps_[i].column + width <= size_; ++i) {
      const int level = level_over(i, width);
      if (level + height <= size_ && (!best || level < best->level)) best = Place{i, level};
    }
    return best;
  }

  // The column of a rectangle that is put there.
  int put(const Place& place, int width, int height) {
    const int column = steps_[place.step].column;
    const int end = column + width;
    auto first = steps_.begin() + static_cast<std::ptrdiff_t>(place.step);
    auto last = first;
    while (last != steps_.end() && last->column + last->width <= end) ++last;
    if (last != steps_.end() && last->column < end) {
      last->width -= end - last->column;
      last->column = end;
    }
    first = steps_.erase(first, last);
    steps_.insert(first, {column, width, place.level + height});
    join_equal();
    return column;
  }

 private:
  int level_over(std::size_t step, int width) const {
    int level = 0;
    for (; width > 0; ++step) {
      level = std::max(level, steps_[step].level);
      width -= steps_[step].width;
    }
    return level;
  }
  void join_equal() {
    for (std::size_t i = 1; i < steps_.size();) {
      if (steps_[i].level != steps_[i - 1].level) {
        ++i;
        continue;
      }
      steps_[i - 1].width += steps_[i].width;
      steps_.erase(steps_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  int size_;
  std::vector<Step> steps_;
};

}  // namespace

std::size_t pack_rectangles(std::vector<PackedRectangle>& rectangles, int page_size) {
  std::vector<std::size_t> order(rectangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rectangles[a].height != rectangles[b].height
               ? rectangles[a].height > rectangles[b].height
               : rectangles[a].width > rectangles[b].width;
  });
  std::vector<Skyline> pages;
  // Pages before it have refused many rectangles in turn, and are left alone.
  std::size_t first_open = 0;
  std::vector<int> refusals;
  constexpr int most_refusals = 200;
  for (const std::size_t index : order) {
    PackedRectangle& rectangle = rectangles[index];
    std::optional<Place> place;
    std::size_t page = first_open;
    for (; page < pages.size() && !place; page += place ? 0 : 1) {
      place = pages[page].find(rectangle.width, rectangle.height);
      if (!place) ++refusals[page];
    }
    if (!place) {
      pages.emplace_back(page_size);
      refusals.push_back(0);
      place = pages.back().find(rectangle.width, rectangle.height);
    }
    rectangle.page = page;
    rectangle.row = place->level;
    rectangle.column = pages[page].put(*place, rectangle.width, rectangle.height);
    while (first_open + 1 < pages.size() && refusals[first_open] > most_refusals) ++first_open;
  }
  return pages.size();
}

}  // namespace libmap
