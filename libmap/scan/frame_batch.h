// How many frames are held in memory side by side: by their size, not by the number of threads,
// which results must not depend on.
#pragma once

#include <cstddef>

#include "libmap/scan/rgbd_frame.h"

namespace libmap {

// Pixels of the frame's cameras, or of its depth image where that has more.
std::size_t image_pixels(const RgbdFrame& frame);

// 8 of up to 2 megapixels each, fewer of larger ones, at least 1.
std::size_t frames_in_batch(std::size_t max_image_pixels);

}  // namespace libmap
