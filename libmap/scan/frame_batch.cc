#include "libmap/scan/frame_batch.h"

#include <algorithm>

namespace libmap {

namespace {

constexpr std::size_t max_frames = 8;
constexpr std::size_t batch_pixels = std::size_t{1} << 24;

}  // namespace

std::size_t image_pixels(const RgbdFrame& frame) {
  std::size_t pixels = 0;
  for (const Camera& camera : frame.cameras)
    pixels += static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  return std::max({pixels, frame.color.pixels.size(), frame.depth.pixels.size()});
}

std::size_t frames_in_batch(std::size_t max_image_pixels) {
  return std::clamp<std::size_t>(batch_pixels / std::max<std::size_t>(max_image_pixels, 1), 1,
                                 max_frames);
}

}  // namespace libmap
