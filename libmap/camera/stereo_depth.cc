#include "libmap/camera/stereo_depth.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr double disparity_unit = 1.0 / 16;  // pixels per unit of cv::StereoSGBM

const std::vector<std::pair<std::string, StereoDirections>> direction_names = {
    {"three", StereoDirections::three},
    {"five", StereoDirections::five},
    {"eight", StereoDirections::eight}};

[[noreturn]] void refuse_pair(const std::string& reason, const std::string& field,
                              const std::string& value, const std::string& bound) {
  throw Error(reason, {.field = field, .value = value, .bound = bound});
}

void check(const GrayImage& image, const Camera& camera, const std::string& field) {
  if (image.width != camera.width || image.height != camera.height)
    refuse_pair("image and calibration differ in size", field + " image",
                size_text(image.width, image.height), size_text(camera.width, camera.height));
  if (camera.is_distorted())
    throw Error("has lens distortion; rectified images are required", {.field = field + " camera"});
}

void check(const StereoCamera& cameras) {
  cameras.left.check();
  cameras.right.check();
  const double ratio = cameras.right.fx / cameras.left.fx;
  if (!(std::abs(ratio - 1) < 1e-3))
    refuse_pair("not rectified: the cameras' focal lengths differ", "right fx",
                to_text(cameras.right.fx), "equal to left fx = " + to_text(cameras.left.fx));
  if (!(cameras.baseline_m > 0) || !std::isfinite(cameras.baseline_m))
    refuse_pair("not a stereo pair", "baseline_m", to_text(cameras.baseline_m), "> 0");
}

StereoDepthOptions checked(StereoDepthOptions options) {
  check_parameters(options);
  if (options.block_px % 2 == 0)
    refuse_pair("an even number", "block_px", std::to_string(options.block_px), "odd");
  options.disparities_px = (options.disparities_px + 15) / 16 * 16;
  return options;
}

int mode_of(StereoDirections directions) {
  if (directions == StereoDirections::three) return cv::StereoSGBM::MODE_SGBM_3WAY;
  return directions == StereoDirections::five ? cv::StereoSGBM::MODE_SGBM : cv::StereoSGBM::MODE_HH;
}

// Repeats border columns on both sides, because SGBM has no result where disparities of the range
// are outside the image.
cv::Mat widened(const GrayImage& image, int left_px, int right_px) {
  // OpenCV has no read-only images, but does not modify this one.
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat wide;
  cv::copyMakeBorder(pixels, wide, 0, 0, left_px, right_px, cv::BORDER_REPLICATE);
  return wide;
}

// Range of gray levels in a square of `side_px` around each pixel.
cv::Mat contrast(const GrayImage& image, int side_px) {
  const cv::Mat pixels = widened(image, 0, 0);
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, cv::Size(side_px, side_px));
  cv::Mat spanned;
  cv::morphologyEx(pixels, spanned, cv::MORPH_GRADIENT, square);
  return spanned;
}

void paste(const DepthImage& part, int x, DepthImage& whole) {
  for (int row = 0; row < part.height; ++row)
    for (int column = 0; column < part.width; ++column)
      whole.at(x + column, row) = part.at(column, row);
}

}  // namespace

void bind(ParameterTable& table, StereoDepthOptions& options) {
  table.add("min_disparity_px", options.min_disparity_px, Range{-1024, 1024},
            "minimum disparity, pixels; below 0 only for converging cameras");
  table.add("disparities_px", options.disparities_px, Range{16, 1024},
            "range of disparities, pixels; minimum depth: fx * baseline / (min_disparity + range)");
  table.add("block_px", options.block_px, Range{1, 31}, "side of the matched window, odd, pixels");
  table.add("uniqueness_percent", options.uniqueness_percent, Range{0, 100},
            "minimum difference between the costs of best and second-best match, % of the latter");
  table.add(
      "left_right_px", options.left_right_px, Range{-1, 1024},
      "maximum difference between the disparities of the left-right check, pixels; -1: disabled");
  table.add("speckle_px", options.speckle_px, Range{0, 1e6},
            "minimum area of a connected patch of similar disparities, pixels; 0: no limit");
  table.add("min_contrast", options.min_contrast, Range{0, 255},
            "minimum range of gray levels in the matched window of the left image");
  table.add("directions", options.directions, direction_names,
            "number of directions along which matching costs are summed");
  table.add("max_depth_m", options.max_depth_m, not_negative, "maximum depth, m; 0: no limit");
}

DepthImage stereo_depth(const GrayImage& left, const GrayImage& right, const StereoCamera& cameras,
                        const StereoDepthOptions& options) {
  check(cameras);
  check(left, cameras.left, "left");
  check(right, cameras.right, "right");
  const StereoDepthOptions in_force = checked(options);
  const int largest = in_force.min_disparity_px + in_force.disparities_px;
  const int border_left = std::max(0, largest);
  const int border_right = std::max(0, -in_force.min_disparity_px);
  const int block2 = in_force.block_px * in_force.block_px;
  // Penalties recommended by OpenCV for one channel.
  const cv::Ptr<cv::StereoSGBM> matcher = cv::StereoSGBM::create(
      in_force.min_disparity_px, in_force.disparities_px, in_force.block_px, 8 * block2,
      32 * block2, in_force.left_right_px, 0, in_force.uniqueness_percent, in_force.speckle_px, 2,
      mode_of(in_force.directions));
  cv::Mat disparities;
  matcher->compute(widened(left, border_left, border_right),
                   widened(right, border_left, border_right), disparities);
  const cv::Mat spanned = contrast(left, in_force.block_px);
  const double limit =
      in_force.max_depth_m > 0 ? in_force.max_depth_m : std::numeric_limits<double>::infinity();
  const double shift = cameras.left.cx - cameras.right.cx;
  DepthImage depth(left.width, left.height);
  for (int y = 0; y < left.height; ++y) {
    const auto* row = disparities.ptr<std::int16_t>(y);
    for (int x = 0; x < left.width; ++x) {
      if (spanned.at<std::uint8_t>(y, x) < in_force.min_contrast) continue;
      const double disparity = row[x + border_left] * disparity_unit;
      const double column = x - disparity;  // in the right image
      if (disparity < in_force.min_disparity_px || column < 0 || column > right.width - 1) continue;
      const double z = cameras.left.fx * cameras.baseline_m / (disparity - shift);
      if (z > 0 && std::isfinite(z) && z <= limit) depth.at(x, y) = static_cast<float>(z);
    }
  }
  return depth;
}

DepthImage stereo_depth(const RgbdFrame& frame, const StereoDepthOptions& options) {
  const std::string node = "node " + std::to_string(frame.node);
  if (frame.stereo.empty() || frame.right.empty() || frame.color.empty())
    throw Error("has no stereo images", {.field = node});
  const auto pairs = static_cast<int>(frame.stereo.size());
  if (frame.right.width % pairs != 0 || frame.color.width % pairs != 0 ||
      frame.color.height != frame.right.height || frame.color.width != frame.right.width)
    refuse_pair("left and right images differ in size or are not of several pairs side by side",
                node + ": right image", size_text(frame.right.width, frame.right.height),
                size_text(frame.color.width, frame.color.height));
  const GrayImage left = luminance(frame.color);
  const int width = left.width / pairs;
  DepthImage depth(left.width, left.height);
  for (int n = 0; n < pairs; ++n) {
    try {
      paste(stereo_depth(crop_columns(left, n * width, width),
                         crop_columns(frame.right, n * width, width),
                         frame.stereo[static_cast<std::size_t>(n)], options),
            n * width, depth);
    } catch (const Error& error) {
      throw error.in_field(node);
    }
  }
  return depth;
}

GrayImage luminance(const ColorImage& image) {
  GrayImage gray(image.width, image.height);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const Color& color = image.pixels[n];
    gray.pixels[n] = static_cast<std::uint8_t>(
        std::lround(0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2]));
  }
  return gray;
}

}  // namespace libmap
