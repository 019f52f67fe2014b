// Reads the images of a report, and reduces their size in bytes.
#pragma once

#include <string>

#include "libmap/core/image.h"
#include "libmap/report/report_content.h"

namespace libmap {

// Returns an image from the content of a file: PNG, JPEG (both are decoded as a check) or SVG.
// Throws Error for another format, a damaged image, or an SVG above 4 MiB.
ReportImage read_image_bytes(std::string bytes);

// Highest level of reduction by fit_image. Level 0 changes nothing.
inline constexpr int max_image_level = 7;

// Encodes the image as JPEG, from level 2 on also with fewer pixels. Returns the given image if it
// is SVG or if the JPEG is not smaller.
ReportImage fit_image(const ReportImage& report_image, int level);

// Scales an image down to `width` x `height` (>= 1) pixels, each the mean over its area.
ColorImage shrink_image(const ColorImage& image, int width, int height);

}  // namespace libmap
