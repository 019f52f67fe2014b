// Caches the rays of all pixels of a lens, which are costly to compute for each frame.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <mutex>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

// True if both cameras have equal size, intrinsics and distortion, and therefore equal rays.
inline bool same_lens(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion;
}

// Keeps the rays of the last lens only, because most scans have one lens. Thread-safe.
class LensRays {
 public:
  using Table = std::vector<Eigen::Vector2d>;

  // Returns ray_table(camera) (camera.h): the rays x/z, y/z of all pixels, row by row.
  std::shared_ptr<const Table> rays_of(const Camera& camera) {
    const std::lock_guard lock(mutex_);
    if (rays_ == nullptr || !same_lens(camera, lens_)) {
      lens_ = camera;
      rays_ = std::make_shared<const Table>(ray_table(camera));
    }
    return rays_;
  }

 private:
  std::mutex mutex_;
  Camera lens_;
  std::shared_ptr<const Table> rays_;
};

}  // namespace libmap
