// Pictures in memory and as PNG.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Three bytes a pixel (red, green, blue), rows from the top, each from the left.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;

  // The pixel in column x (from the left) of row y (from the top); both must be inside.
  Color at(int x, int y) const {
    const std::size_t start = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                   static_cast<std::size_t>(x));
    return {rgb[start], rgb[start + 1], rgb[start + 2]};
  }
  bool operator==(const Image&) const = default;
};

// The image as the bytes of a PNG file (8 bits RGB, no time stamp: equal images, equal bytes).
// Throws Error if the size is 0 or does not fit the number of bytes.
std::string to_png(const Image& image);

// to_png as a file, whole or not at all.
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace libmap
