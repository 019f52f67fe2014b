#include "libmap/camera/color_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

// Half extent (x/z, y/z) of the largest rectangle around the optical axis that is inside the image.
Eigen::Vector2d inner_reach(const Camera& camera) {
  Eigen::Vector2d reach = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  const auto meet = [&](double u, double v, Eigen::Index axis, double side) {
    if (const auto ray = pixel_to_ray(camera, {u, v}))
      reach[axis] = std::min(reach[axis], side * (*ray)[axis]);
  };
  for (int row = 0; row < camera.height; ++row) {
    meet(0.0, row, 0, -1.0);
    meet(camera.width - 1.0, row, 0, 1.0);
  }
  for (int column = 0; column < camera.width; ++column) {
    meet(column, 0.0, 1, -1.0);
    meet(column, camera.height - 1.0, 1, 1.0);
  }
  return reach;
}

// Number of pixels with at most `half_extent` on each side of the center: odd if the principal
// point is closer to a pixel's center, else even, so that pixels of both images coincide.
int centered_size(double half_extent, double principal_point) {
  constexpr double rounding = 1e-9;
  const bool odd = std::llround(2.0 * principal_point) % 2 == 0;
  // Limits the integer range; images are smaller.
  half_extent = std::min(half_extent, 1e8);
  return odd ? 2 * static_cast<int>(std::floor(half_extent + rounding)) + 1
             : 2 * static_cast<int>(std::floor(half_extent + 0.5 + rounding));
}

}  // namespace

Camera centered_pinhole(const Camera& camera) {
  camera.check();
  const Eigen::Vector2d reach = inner_reach(camera);
  if (!(reach.minCoeff() > 0.0) || !reach.allFinite())
    throw Error("the optical axis is outside the image",
                {.field = "principal point",
                 .value = to_text(camera.cx) + ", " + to_text(camera.cy),
                 .bound = "inside " + size_text(camera.width, camera.height)});
  Camera centered = without_distortion(camera);
  const double focal = std::max(camera.fx, camera.fy);
  // Limits the size for fisheye lenses of wide angle.
  centered.width = std::min(centered_size(focal * reach.x(), camera.cx), 2 * camera.width + 1);
  centered.height = std::min(centered_size(focal * reach.y(), camera.cy), 2 * camera.height + 1);
  centered.width = std::max(centered.width, 1);
  centered.height = std::max(centered.height, 1);
  centered.fx = centered.fy = focal;
  centered.cx = (centered.width - 1) / 2.0;
  centered.cy = (centered.height - 1) / 2.0;
  return centered;
}

ColorImage resample_image(const ColorImage& image, const Camera& from, const Camera& to) {
  if (image.width != from.width || image.height != from.height)
    throw Error("image and camera differ in size", {.field = "size",
                                                    .value = size_text(image.width, image.height),
                                                    .bound = size_text(from.width, from.height)});
  cv::Mat source_pixels(to.height, to.width, CV_32FC2);
  parallel_for(static_cast<std::size_t>(to.height), 16, [&](std::size_t begin, std::size_t end) {
    for (auto row = static_cast<int>(begin); row < static_cast<int>(end); ++row)
      for (int column = 0; column < to.width; ++column) {
        const Eigen::Vector2d pixel =
            distort_to_pixel(from, {(column - to.cx) / to.fx, (row - to.cy) / to.fy});
        source_pixels.at<cv::Vec2f>(row, column) = {static_cast<float>(pixel.x()),
                                             static_cast<float>(pixel.y())};
      }
  });
  ColorImage result(to.width, to.height);
  const cv::Mat source(image.height, image.width, CV_8UC3, const_cast<Color*>(image.pixels.data()));
  cv::Mat target(to.height, to.width, CV_8UC3, result.pixels.data());
  cv::remap(source, target, source_pixels, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return result;
}

namespace {

// Luminance (ITU-R BT.601) after a binomial blur of 3 x 3 pixels.
Image<float> blurred_luminance(const ColorImage& image) {
  Image<float> gray(image.width, image.height);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const Color& color = image.pixels[n];
    gray.pixels[n] = 0.299F * static_cast<float>(color[0]) + 0.587F * static_cast<float>(color[1]) +
                     0.114F * static_cast<float>(color[2]);
  }
  Image<float> along_rows = gray;
  for (int y = 0; y < gray.height; ++y)
    for (int x = 1; x + 1 < gray.width; ++x)
      along_rows.at(x, y) = 0.5F * gray.at(x, y) + 0.25F * (gray.at(x - 1, y) + gray.at(x + 1, y));
  for (int y = 1; y + 1 < gray.height; ++y)
    for (int x = 0; x < gray.width; ++x)
      gray.at(x, y) =
          0.5F * along_rows.at(x, y) + 0.25F * (along_rows.at(x, y - 1) + along_rows.at(x, y + 1));
  return gray;
}

}  // namespace

double image_sharpness(const ColorImage& image) {
  if (image.width < 5 || image.height < 5) return 0.0;
  const Image<float> gray = blurred_luminance(image);
  double bends = 0.0;
  double slopes = 0.0;
  for (int y = 1; y + 1 < gray.height; ++y)
    for (int x = 1; x + 1 < gray.width; ++x) {
      const float across = gray.at(x + 1, y) - gray.at(x - 1, y);
      const float down = gray.at(x, y + 1) - gray.at(x, y - 1);
      const float bend = gray.at(x + 1, y) + gray.at(x - 1, y) + gray.at(x, y + 1) +
                         gray.at(x, y - 1) - 4.0F * gray.at(x, y);
      bends += static_cast<double>(bend * bend);
      slopes += static_cast<double>(across * across + down * down);
    }
  return slopes > 0.0 ? bends / slopes : 0.0;
}

}  // namespace libmap
