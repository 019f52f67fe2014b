#include "libmap/fusion/depth_projection.h"

#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/scan/lens_rays.h"

namespace libmap {

PixelRays pixel_rays(const Camera& camera) {
  const std::vector<Eigen::Vector2d> table = ray_table(camera);
  PixelRays rays;
  rays.width = camera.width;
  rays.height = camera.height;
  rays.x.assign(table.size() + PixelRays::padding, 0.0F);
  rays.y.assign(table.size() + PixelRays::padding, 0.0F);
  rays.min.setConstant(std::numeric_limits<double>::infinity());
  rays.max = -rays.min;
  for (std::size_t n = 0; n < table.size(); ++n) {
    if (!table[n].allFinite()) {
      rays.blind.push_back(n);
      continue;
    }
    rays.x[n] = static_cast<float>(table[n].x());
    rays.y[n] = static_cast<float>(table[n].y());
    rays.min = rays.min.cwiseMin(table[n]);
    rays.max = rays.max.cwiseMax(table[n]);
  }
  return rays;
}

std::shared_ptr<const PixelRays> PixelRayCache::rays_of(const Camera& camera) {
  const std::lock_guard lock(mutex_);
  for (const auto& [lens, rays] : known_)
    if (same_lens(lens, camera)) return rays;
  known_.emplace_back(camera, std::make_shared<const PixelRays>(pixel_rays(camera)));
  pixels_ += known_.back().second->x.size();
  while (pixels_ > max_pixels_ && known_.size() > 1) {
    pixels_ -= known_.front().second->x.size();
    known_.erase(known_.begin());
  }
  return known_.back().second;
}

}  // namespace libmap
