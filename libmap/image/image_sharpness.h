// How sharp a photograph is.
#pragma once

#include "libmap/core/image.h"

namespace libmap {

// How fine the structures of an image are that have contrast at all: the sum of the squares of its
// Laplacian over that of its gradient, both after a blur of one pixel, against noise. Comparable
// among pictures of one scene and size. 0 for a plain image, or one smaller than 5 x 5.
double image_sharpness(const ColorImage& image);

}  // namespace libmap
