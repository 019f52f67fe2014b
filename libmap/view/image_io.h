// Pictures in memory and as PNG.
#pragma once

#include <filesystem>
#include <string>

#include "libmap/core/image.h"

namespace libmap {

// The image as the bytes of a PNG file (8 bits RGB, no time stamp: equal images, equal bytes).
// Throws Error if the size is 0 or does not fit the number of pixels.
std::string to_png(const ColorImage& image);

}  // namespace libmap
