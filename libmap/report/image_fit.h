// Reads the images of a report, and reduces their size in bytes.
#pragma once

#include <string>

#include "libmap/core/image.h"
#include "libmap/report/report_content.h"

namespace libmap {

// Returns the image with the file content `bytes`: PNG, JPEG (both are decoded as a check) or SVG.
// Throws Error for another format, a damaged image, or an SVG above 4 MiB.
ReportImage read_image_bytes(std::string bytes);

// Highest level of reduction; level 0 changes nothing.
inline constexpr int max_image_level = 7;

// Encodes the image as JPEG, from level 2 on also with fewer pixels. Returns it unchanged if the
// result is not smaller, or if it is SVG.
ReportImage fit_image(const ReportImage& report_image, int level);

// Scales an image down by averaging over the area of each new pixel. `width` and `height` are >= 1.
ColorImage shrink_image(const ColorImage& image, int width, int height);

}  // namespace libmap
