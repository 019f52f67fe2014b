// Resamples color images to a pinhole camera, and measures the sharpness of images.
#pragma once

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// Camera with square pixels, no distortion and the principal point at the image center, ((width -
// 1) / 2, (height - 1) / 2), with the largest image around the optical axis that `camera` covers
// completely. The focal length is max(fx, fy) of `camera`. If `camera` differs only in a principal
// point at whole or half pixels, pixels of both cameras coincide, so that resampling crops the
// image. Throws Error for an invalid camera, or one with the optical axis outside the image.
Camera centered_pinhole(const Camera& camera);

// Resamples an image of camera `from` to camera `to` with the same pose: bicubic, in steps of 1/32
// pixel. Pixels of `from` that coincide with pixels of `to` are not changed. Throws Error if the
// image does not have the size of `from`.
ColorImage resample_image(const ColorImage& image, const Camera& from, const Camera& to);

// Sharpness of an image: sum of squared Laplacians over sum of squared gradients, both after a blur
// by one pixel that reduces noise. Comparable among images of one scene and size. 0 for a uniform
// image, or one with fewer than 5 columns or rows.
double image_sharpness(const ColorImage& image);

}  // namespace libmap
