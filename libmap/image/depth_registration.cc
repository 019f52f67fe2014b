#include "libmap/image/depth_registration.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace libmap {

namespace {

// The pixels whose centers a pixel's image covers; empty where it falls on none.
struct PixelBox {
  int left = 0;
  int top = 0;
  int right = -1;
  int bottom = -1;
};

PixelBox covered_pixels(const Camera& camera, const Camera& target, const Pose& target_from_camera,
                        const Eigen::Vector2d& pixel, double depth_m) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Eigen::Array2d low(infinity, infinity);
  Eigen::Array2d high = -low;
  for (const double shift : {-0.5, 0.5}) {
    const auto ray =
        pixel_to_ray(camera, Eigen::Vector2d(pixel + Eigen::Vector2d::Constant(shift)));
    if (!ray) return {};
    const auto seen = project_point(target, target_from_camera * (depth_m * ray->homogeneous()));
    if (!seen) return {};
    low = low.min(seen->array());
    high = high.max(seen->array());
  }
  if (!(high >= 0.0).all() || !(low.x() < target.width) || !(low.y() < target.height)) return {};
  return {std::max(0, static_cast<int>(std::ceil(low.x()))),
          std::max(0, static_cast<int>(std::ceil(low.y()))),
          static_cast<int>(std::min(std::floor(high.x()), target.width - 1.0)),
          static_cast<int>(std::min(std::floor(high.y()), target.height - 1.0))};
}

}  // namespace

DepthImage register_depth(const DepthImage& depth, const Camera& camera, const Camera& target,
                          const Pose& target_from_camera) {
  DepthImage registered(target.width, target.height);
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const auto z = static_cast<double>(depth.at(x, y));
      const auto ray = pixel_to_ray(camera, Eigen::Vector2d(x, y));
      if (!(z > 0.0) || !ray) continue;
      const double seen_z = (target_from_camera * Eigen::Vector3d(z * ray->homogeneous())).z();
      if (!(seen_z > 0.0)) continue;
      const PixelBox box = covered_pixels(camera, target, target_from_camera, {x, y}, z);
      for (int row = box.top; row <= box.bottom; ++row)
        for (int column = box.left; column <= box.right; ++column) {
          float& there = registered.at(column, row);
          if (there == 0.0F || seen_z < static_cast<double>(there))
            there = static_cast<float>(seen_z);
        }
    }
  return registered;
}

}  // namespace libmap
