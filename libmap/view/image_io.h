// Encodes images as PNG.
#pragma once

#include <filesystem>
#include <string>

#include "libmap/core/image.h"

namespace libmap {

// Encodes an image as a PNG file (8-bit RGB without a time stamp: equal images give equal bytes).
// Throws Error if the size is 0, too large for PNG, or does not match the number of pixels.
std::string to_png(const ColorImage& image);

}  // namespace libmap
