// Rays of the pixels of a lens, computed once.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <mutex>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

// Whether the pixels of both cameras have the same rays.
inline bool same_lens(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion;
}

// Keeps the table of the last lens: most scans have one lens. May be used from several threads.
class LensRays {
 public:
  using Table = std::vector<Eigen::Vector2d>;

  // ray_table of this camera.
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
