// Resamples color images to a pinhole camera, and measures the sharpness of images.
#pragma once

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// Camera with square pixels, no distortion and the principal point at the image center, ((width -
// 1) / 2, (height - 1) / 2), with the largest image around the optical axis that `camera` covers
// completely. The focal length is max(fx, fy) of `camera`. If `camera` differs only in the
// principal point, at whole or half pixels, pixels equal the pixels of `camera`, cropped at the
// border. Throws Error: an invalid camera, or a camera with the optical axis outside the image.
Camera centered_pinhole(const Camera& camera);

// Resamples an image of camera `from` to camera `to` with the same pose: bicubic, in steps of 1/32
// pixel. Pixels of `from` that coincide with pixels of `to` are not changed. Throws Error if the
// image does not have the size of `from`.
ColorImage resample_image(const ColorImage& image, const Camera& from, const Camera& to);

// Sharpness of an image: sum of squared Laplacians over sum of squared gradients, both after a blur
// of one pixel against noise. Comparable among images of one scene and size. 0 for a uniform image,
// or one smaller than 5 x 5.
double image_sharpness(const ColorImage& image);

}  // namespace libmap
