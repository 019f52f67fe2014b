// Images as plain data, row by row from the top left. Pixel centers have whole coordinates:
// column x, row y.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

template <typename T>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<T> pixels;  // width * height

  Image() = default;
  Image(int w, int h, const T& fill = T{})
      : width(w),
        height(h),
        pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {}

  bool empty() const { return pixels.empty(); }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
  T& at(int x, int y) { return pixels[index(x, y)]; }
  const T& at(int x, int y) const { return pixels[index(x, y)]; }

  bool operator==(const Image&) const = default;
};

using ColorImage = Image<Color>;
using GrayImage = Image<std::uint8_t>;
// Distance from the camera's plane (its z) in meters; 0 where nothing was measured.
using DepthImage = Image<float>;

// "640 x 480".
inline std::string size_text(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

// Columns `x` to `x + width - 1`, one of several pictures that stand side by side.
template <typename T>
Image<T> crop_columns(const Image<T>& image, int x, int width) {
  Image<T> part(width, image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < width; ++column) part.at(column, row) = image.at(x + column, row);
  return part;
}

}  // namespace libmap
