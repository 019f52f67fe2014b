// Images as plain data in row-major order from the top left. Pixel centers have whole coordinates:
// column x, row y.
#pragma once

#include <Eigen/Core>
#include <algorithm>
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
  std::vector<T> pixels;  // width * height values, row by row

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
// Depth z in the camera's optical frame, m; 0 for pixels without a measurement.
using DepthImage = Image<float>;

// Returns a size as text, e.g. "640 x 480".
inline std::string size_text(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

// Returns columns `x` to `x + width - 1`, e.g. one of two images that are stored side by side.
template <typename T>
Image<T> crop_columns(const Image<T>& image, int x, int width) {
  Image<T> part(width, image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < width; ++column) part.at(column, row) = image.at(x + column, row);
  return part;
}

// Returns the bilinearly interpolated color, 0 to 255, at a pixel position (clamped to the image).
template <typename Pixel>
Eigen::Vector3f bilinear_color(const Image<Pixel>& image, double x, double y) {
  const double within_x = std::clamp(x, 0.0, image.width - 1.0);
  const double within_y = std::clamp(y, 0.0, image.height - 1.0);
  const int left = std::min(static_cast<int>(within_x), std::max(image.width - 2, 0));
  const int top = std::min(static_cast<int>(within_y), std::max(image.height - 2, 0));
  const int right = std::min(left + 1, image.width - 1);
  const int bottom = std::min(top + 1, image.height - 1);
  const auto u = static_cast<float>(within_x - left);
  const auto v = static_cast<float>(within_y - top);
  const auto color_at = [&image](int column, int row) {
    const Pixel& pixel = image.at(column, row);
    return Eigen::Vector3f(pixel[0], pixel[1], pixel[2]);
  };
  return (1.0F - v) * ((1.0F - u) * color_at(left, top) + u * color_at(right, top)) +
         v * ((1.0F - u) * color_at(left, bottom) + u * color_at(right, bottom));
}

}  // namespace libmap
