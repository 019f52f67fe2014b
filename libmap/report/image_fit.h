// Reads the images of a report and reduces the size in bytes.
#pragma once

#include <string>

#include "libmap/core/image.h"
#include "libmap/report/report_content.h"

namespace libmap {

// Reads a PNG, JPEG or SVG, recognized by content. Decodes PNG and JPEG once to check them. Throws
// Error: another format, a damaged image, or an SVG above 4 MiB.
ReportImage read_image_bytes(std::string bytes);

// Highest level of reduction; level 0 changes nothing.
inline constexpr int max_image_level = 7;

// Encodes the image as JPEG, from level 2 on also with fewer pixels. Returns `image` if that is
// smaller, or if it is SVG.
ReportImage fit_image(const ReportImage& report_image, int level);

// Scales an image down by averaging over the area of each new pixel. `width` and `height` are >= 1.
ColorImage shrink_image(const ColorImage& image, int width, int height);

}  // namespace libmap
