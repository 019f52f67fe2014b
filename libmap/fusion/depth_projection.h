// The rays of a camera's pixels.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// x/z and y/z of each pixel's ray in single precision, row by row, lens distortion undone. Some
// entries more than pixels, so that as many may be read at once anywhere.
struct PixelRays {
  static constexpr std::size_t padding = 16;
  int width = 0;
  int height = 0;
  std::vector<float> x;
  std::vector<float> y;
  std::vector<std::size_t> blind;  // pixels without a ray; x and y are 0 there
  // Of all rays.
  Eigen::Vector2d min = Eigen::Vector2d::Zero();
  Eigen::Vector2d max = Eigen::Vector2d::Zero();
};
PixelRays pixel_rays(const Camera& camera);

// The rays of each lens once. May be used from several threads.
class PixelRayCache {
 public:
  // Keeps the lenses that came last, of so many pixels in all (256 MB): a telephone's focus gives
  // each of its images a lens of its own.
  explicit PixelRayCache(std::size_t max_pixels = std::size_t{1} << 25U)
      : max_pixels_(max_pixels) {}

  // Computed at the first call for this camera.
  std::shared_ptr<const PixelRays> rays_of(const Camera& camera);

 private:
  std::mutex mutex_;
  std::vector<std::pair<Camera, std::shared_ptr<const PixelRays>>> known_;  // the oldest first
  std::size_t max_pixels_;
  std::size_t pixels_ = 0;
};

}  // namespace libmap
