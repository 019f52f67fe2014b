// Pictures made smaller, so that a page keeps its size.
#pragma once

#include <string>

#include "libmap/core/image.h"
#include "libmap/report/report_content.h"

namespace libmap {

// PNG, JPEG or SVG by the first bytes, decoded once to see that it is whole. Throws Error: none of
// them, or damaged.
ReportPicture read_picture_bytes(std::string bytes);

// No picture is changed at level 0; at the highest they are small.
inline constexpr int max_picture_level = 7;

// The picture as JPEG, from level 2 on also with fewer pixels; itself where that is smaller. SVG
// stays as it is.
ReportPicture fit_picture(const ReportPicture& picture, int level);

// By the mean of the pixels that each new one covers. Sizes from 1 up.
ColorImage shrink_image(const ColorImage& image, int width, int height);

}  // namespace libmap
