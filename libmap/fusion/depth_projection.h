// Computes and caches the undistorted viewing rays of all pixels of a camera.
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

// x/z and y/z of each pixel's undistorted ray, row by row. `padding` more entries follow, so that
// vectorized reads may exceed the last pixel.
struct PixelRays {
  static constexpr std::size_t padding = 16;
  int width = 0;
  int height = 0;
  std::vector<float> x;
  std::vector<float> y;
  std::vector<std::size_t> blind;  // indices of pixels without a ray; x and y are 0
  // Bounds of all rays.
  Eigen::Vector2d min = Eigen::Vector2d::Zero();
  Eigen::Vector2d max = Eigen::Vector2d::Zero();
};
PixelRays pixel_rays(const Camera& camera);

// Caches the rays of each camera. Can be used from several threads.
class PixelRayCache {
 public:
  // Keeps the rays of the latest cameras with this total number of pixels (256 MB by default). The
  // number is limited because autofocus changes the camera for each image.
  explicit PixelRayCache(std::size_t max_pixels = std::size_t{1} << 25U)
      : max_pixels_(max_pixels) {}

  // Returns the rays, which the first call for a camera computes.
  std::shared_ptr<const PixelRays> rays_of(const Camera& camera);

 private:
  std::mutex mutex_;
  std::vector<std::pair<Camera, std::shared_ptr<const PixelRays>>> known_;  // oldest first
  std::size_t max_pixels_;
  std::size_t pixels_ = 0;
};

}  // namespace libmap
