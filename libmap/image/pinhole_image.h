// Photographs as a camera without distortion would have taken them.
#pragma once

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// The camera with square pixels, no distortion and its principal point exactly in the middle of the
// image, ((width - 1) / 2, (height - 1) / 2), that shows as much of what `camera` shows as fits
// into a rectangle about its optical axis. Its focal length is the longer one of `camera`. Where
// only the principal point is off the middle and lies on whole or half pixels its pixels are those
// of `camera`, columns and rows at the border left out. Throws Error: `camera` cannot be, or its
// optical axis does not meet its image.
Camera centered_pinhole(const Camera& camera);

// The image of `from` as `to` sees it from the same place, in the same direction: bicubic, to 1/32
// of a pixel; pixels of `from` that fall on pixels of `to` are kept as they are. Throws Error if
// the image has not the size of `from`.
ColorImage resample_image(const ColorImage& image, const Camera& from, const Camera& to);

}  // namespace libmap
