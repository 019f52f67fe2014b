// Photographs as a camera without distortion would have taken them, and how sharp they are.
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

// How fine the structures of an image are that have contrast at all: the sum of the squares of its
// Laplacian over that of its gradient, both after a blur of one pixel, against noise. Comparable
// among pictures of one scene and size. 0 for a plain image, or one smaller than 5 x 5.
double image_sharpness(const ColorImage& image);

}  // namespace libmap
