#include "libmap/features/features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/fusion/depth_projection.h"

namespace features_test {

using libmap::FeatureOptions;
using libmap::FeatureType;

// Separate round spots on a wall at 2 m; odd numbers of rows and columns.
struct SpottedWall {
  libmap::CameraView view;
  std::vector<Eigen::Vector2d> spots;

  SpottedWall(int width, int height, double spot_px) {
    libmap::Camera& camera = view.color_camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = 0.8 * width;
    camera.cx = 0.5 * (width - 1);
    camera.cy = 0.5 * (height - 1);
    view.depth_camera = camera;
    view.depth_camera.width = 64;
    view.depth_camera.height = 48;
    view.depth_camera.fx = view.depth_camera.fy = 0.8 * 64;
    view.depth_camera.cx = 31.5;
    view.depth_camera.cy = 23.5;
    view.depth = libmap::DepthImage(64, 48, 2.0F);
    view.color = libmap::ColorImage(width, height, libmap::Color{60, 60, 60});
    const int step = static_cast<int>(20 * spot_px);
    for (int row = 2 * step; row + 2 * step < height; row += step)
      for (int column = 2 * step; column + 2 * step < width; column += step)
        add_spot({column + 0.37 * (row % 7), row + 0.41 * (column % 5)}, spot_px);
  }

  double distance_px(const Eigen::Vector2d& pixel) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& spot : spots) nearest = std::min(nearest, (spot - pixel).norm());
    return nearest;
  }

 private:
  void add_spot(const Eigen::Vector2d& center, double spot_px) {
    spots.push_back(center);
    const int reach = static_cast<int>(5 * spot_px);
    const auto x0 = static_cast<int>(center.x());
    const auto y0 = static_cast<int>(center.y());
    for (int y = y0 - reach; y <= y0 + reach; ++y)
      for (int x = x0 - reach; x <= x0 + reach; ++x) {
        const double off = (Eigen::Vector2d(x, y) - center).squaredNorm();
        const auto value = static_cast<std::uint8_t>(
            60.0 + std::round(180.0 * std::exp(-0.5 * off / (spot_px * spot_px))));
        view.color.at(x, y) = {value, value, value};
      }
  }
};

libmap::FrameFeatures features_of(const libmap::CameraView& view, const FeatureOptions& options) {
  libmap::FrameFeatures frame;
  frame.type = options.type;
  frame.cameras.push_back(view.color_camera);
  libmap::PixelRayCache rays;
  add_features(view, fit_depth_planes(view.depth, *rays.rays_of(view.depth_camera)), options,
               frame);
  return frame;
}

// Images above 4 megapixels are halved; positions are in pixels of the full image.
TEST(Features, PlacesInImagesThatAreHalved) {
  for (const auto& [width, height, scale] :
       {std::tuple{1281, 961, 1.0}, {2561, 1921, 2.0}, {2881, 1601, 2.0}}) {
    SCOPED_TRACE(width);
    const SpottedWall wall(width, height, 4.0 * scale);
    const libmap::FrameFeatures frame = features_of(wall.view, FeatureOptions());
    ASSERT_GE(frame.features.size(), wall.spots.size());
    std::size_t near = 0;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const libmap::Feature& feature : frame.features) {
      EXPECT_NEAR(feature.depth_m, 2.0F, 1e-3F);
      EXPECT_GE(feature.pixel_noise_px, static_cast<float>(0.15 * scale) * 0.999F);
      const auto pixel = distort_to_pixel(wall.view.color_camera, feature.ray.cast<double>());
      const double off = wall.distance_px(pixel);
      if (off > 1.0) continue;
      ++near;
      for (const Eigen::Vector2d& spot : wall.spots)
        if ((spot - pixel).norm() == off) mean += pixel - spot;
    }
    ASSERT_GE(near, wall.spots.size());
    mean /= static_cast<double>(near);
    EXPECT_LT(mean.norm(), 0.05 * scale);
  }
}

}  // namespace features_test
