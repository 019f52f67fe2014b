// Resamples color images to a pinhole camera, and measures the sharpness of images.
#pragma once

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// Returns a camera without distortion, with square pixels and the principal point at the image
// center, ((width - 1) / 2, (height - 1) / 2). Its image is the largest around the optical axis
// that `camera` covers, at most twice as wide and high as that of `camera`. The focal length is
// max(fx, fy) of `camera`. If `camera` is undistorted, with square pixels and a principal point at
// whole or half pixels, pixels of both cameras coincide, so that resampling crops the image. Throws
// Error for an invalid camera, or if the optical axis is outside the image.
Camera centered_pinhole(const Camera& camera);

// Resamples an image of camera `from` to camera `to` with the same pose: bicubic, in steps of 1/32
// pixel. Pixels of `from` that coincide with pixels of `to` keep their values. Throws Error if the
// image does not have the size of `from`.
ColorImage resample_image(const ColorImage& image, const Camera& from, const Camera& to);

// Returns the sharpness of an image: sum of squared Laplacians over sum of squared gradients, both
// after a blur by one pixel that reduces noise. Values of one scene and image size are comparable.
// 0 for a uniform image, or one with fewer than 5 columns or rows.
double image_sharpness(const ColorImage& image);

}  // namespace libmap
