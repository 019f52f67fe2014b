#include "libmap/camera/stereo_depth.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/test_support.h"

namespace stereo_depth_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::DepthImage;
using libmap::GrayImage;
using libmap::StereoCamera;
using libmap::StereoDepthOptions;

constexpr int width = 200;
constexpr int height = 120;

StereoCamera pair_of_cameras() {
  StereoCamera cameras;
  cameras.left.width = width;
  cameras.left.height = height;
  cameras.left.fx = cameras.left.fy = 250;
  cameras.left.cx = 101.5;
  cameras.left.cy = 60;
  cameras.right = cameras.left;
  cameras.right.cx = 98.25;  // rectified pairs may have different principal points
  cameras.baseline_m = 0.12;
  return cameras;
}

// A value per square of 8 mm of a wall, smooth in between, the same for every call.
double texture(double x, double y) {
  const auto lattice = [](double column, double row) {
    auto hash = static_cast<std::uint64_t>(static_cast<std::int64_t>(column) * 73856093 ^
                                           static_cast<std::int64_t>(row) * 19349663);
    hash ^= hash >> 33U;
    hash *= 0xff51afd7ed558ccdULL;
    hash ^= hash >> 33U;
    return static_cast<double>(hash % 256);
  };
  const double u = x / 0.008;
  const double v = y / 0.008;
  const double i = std::floor(u);
  const double j = std::floor(v);
  const double a = u - i;
  const double b = v - j;
  return (1 - a) * (1 - b) * lattice(i, j) + a * (1 - b) * lattice(i + 1, j) +
         (1 - a) * b * lattice(i, j + 1) + a * b * lattice(i + 1, j + 1);
}

// A wall 1.5 m away, slanted by `slope`, and in front of it, for `step_x` < x, one at 1 m. In the
// left camera's frame.
struct Scene {
  double slope = 0.0;
  double step_x = 1e9;

  double depth(double ray_x, double eye_x) const {
    const double near_x = eye_x + ray_x * 1.0;
    if (near_x > step_x) return 1.0;
    // z = 1.5 + slope x, x = eye_x + ray_x z.
    return (1.5 + slope * eye_x) / (1 - slope * ray_x);
  }
};

GrayImage view_of(const Scene& scene, const libmap::Camera& camera, double eye_x) {
  GrayImage image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double ray_x = (x - camera.cx) / camera.fx;
      const double z = scene.depth(ray_x, eye_x);
      const double wall = z == 1.0 ? 7.0 : 0.0;  // another piece of the texture
      image.at(x, y) = static_cast<std::uint8_t>(
          std::lround(texture(eye_x + ray_x * z + wall, (y - camera.cy) / camera.fy * z)));
    }
  return image;
}

struct Comparison {
  double fraction = 0.0;  // with a depth
  double rms = 0.0;       // relative
};

Comparison compare(const DepthImage& depth, const Scene& scene, const libmap::Camera& camera,
                   int from_x, int to_x) {
  Comparison result;
  int measured = 0;
  for (int y = 5; y < height - 5; ++y)
    for (int x = from_x; x < to_x; ++x) {
      if (depth.at(x, y) == 0) continue;
      const double truth = scene.depth((x - camera.cx) / camera.fx, 0.0);
      result.rms += std::pow(depth.at(x, y) / truth - 1, 2);
      ++measured;
    }
  result.fraction = static_cast<double>(measured) / ((to_x - from_x) * (height - 10));
  result.rms = std::sqrt(result.rms / std::max(1, measured));
  return result;
}

TEST(StereoDepth, SlantedWall) {
  const StereoCamera cameras = pair_of_cameras();
  for (const double slope : {0.0, 0.6, -0.6}) {
    const Scene scene{.slope = slope};
    for (const auto directions : {libmap::StereoDirections::three, libmap::StereoDirections::five,
                                  libmap::StereoDirections::eight}) {
      StereoDepthOptions options;
      options.disparities_px = 48;
      options.directions = directions;
      const DepthImage depth = stereo_depth(view_of(scene, cameras.left, 0),
                                            view_of(scene, cameras.right, 0.12), cameras, options);
      // Left of 30 the right camera sees less of the wall.
      const Comparison result = compare(depth, scene, cameras.left, 45, 195);
      EXPECT_GT(result.fraction, 0.97) << slope;
      // A quarter of a pixel of some 20 px of disparity.
      EXPECT_LT(result.rms, 0.0125) << slope;
    }
  }
}

TEST(StereoDepth, StepOfKnownDepth) {
  const StereoCamera cameras = pair_of_cameras();
  const Scene scene{.slope = 0.0, .step_x = 0.05};
  StereoDepthOptions options;
  options.disparities_px = 48;
  const DepthImage depth = stereo_depth(view_of(scene, cameras.left, 0),
                                        view_of(scene, cameras.right, 0.12), cameras, options);
  // The step stands at column 101.5 + 250 * 0.05 = 114.
  const Comparison far = compare(depth, scene, cameras.left, 45, 98);
  const Comparison near = compare(depth, scene, cameras.left, 118, 195);
  EXPECT_GT(far.fraction, 0.95);
  EXPECT_GT(near.fraction, 0.97);
  EXPECT_LT(far.rms, 0.0125);
  EXPECT_LT(near.rms, 0.0125);
  // The 0.12 (1/1 - 1/1.5) 250 = 10 columns that only the left camera sees have no depth.
  for (int y = 5; y < height - 5; ++y)
    for (int x = 45; x < 195; ++x)
      EXPECT_TRUE(depth.at(x, y) == 0 || (depth.at(x, y) > 0.95F && depth.at(x, y) < 1.6F));
  options.max_depth_m = 1.2;
  const DepthImage cut = stereo_depth(view_of(scene, cameras.left, 0),
                                      view_of(scene, cameras.right, 0.12), cameras, options);
  EXPECT_EQ(compare(cut, scene, cameras.left, 45, 98).fraction, 0.0);
  EXPECT_GT(compare(cut, scene, cameras.left, 118, 195).fraction, 0.97);
}

TEST(StereoDepth, NothingFromImagesWithoutTexture) {
  const GrayImage blank(width, height, 100);
  StereoCamera cameras = pair_of_cameras();
  EXPECT_EQ(stereo_depth(blank, blank, cameras).pixels, DepthImage(width, height).pixels);
  // A disparity of 0 would be a depth of 9 m here.
  std::swap(cameras.left.cx, cameras.right.cx);
  EXPECT_EQ(stereo_depth(blank, blank, cameras).pixels, DepthImage(width, height).pixels);
  StereoDepthOptions options;
  options.min_contrast = 0;
  EXPECT_NE(stereo_depth(blank, blank, cameras, options).pixels, DepthImage(width, height).pixels);
}

TEST(StereoDepth, FramesOfSeveralPairs) {
  const StereoCamera cameras = pair_of_cameras();
  const Scene scenes[] = {{.slope = 0.3}, {.slope = -0.3}};
  libmap::RgbdFrame frame;
  frame.node = 7;
  frame.color = libmap::ColorImage(2 * width, height);
  frame.right = GrayImage(2 * width, height);
  frame.stereo = {cameras, cameras};
  for (int n = 0; n < 2; ++n) {
    const GrayImage left = view_of(scenes[n], cameras.left, 0);
    const GrayImage right = view_of(scenes[n], cameras.right, 0.12);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const std::uint8_t value = left.at(x, y);
        frame.color.at(n * width + x, y) = {value, value, value};
        frame.right.at(n * width + x, y) = right.at(x, y);
      }
  }
  StereoDepthOptions options;
  options.disparities_px = 48;
  const DepthImage depth = stereo_depth(frame, options);
  ASSERT_EQ(depth.width, 2 * width);
  for (int n = 0; n < 2; ++n)
    EXPECT_EQ(crop_columns(depth, n * width, width),
              stereo_depth(view_of(scenes[n], cameras.left, 0),
                           view_of(scenes[n], cameras.right, 0.12), cameras, options));
  frame.stereo.clear();
  EXPECT_TRUE(is_error(error_of([&] { stereo_depth(frame); }), {.field = "node 7"}));
  frame.stereo = {cameras};
  EXPECT_TRUE(
      is_error(error_of([&] { stereo_depth(frame); }),
               {.field = "node 7: left image", .value = "400 x 120", .bound = "200 x 120"}));
}

TEST(StereoDepth, WrongArgumentsAreNamed) {
  const GrayImage image(width, height, 100);
  const auto said = [&](const StereoCamera& cameras, const StereoDepthOptions& options) {
    return error_of([&] { stereo_depth(image, image, cameras, options); });
  };
  StereoCamera cameras = pair_of_cameras();
  cameras.baseline_m = 0;
  EXPECT_TRUE(is_error(said(cameras, {}), {.field = "baseline_m", .value = "0", .bound = "> 0"}));
  cameras = pair_of_cameras();
  cameras.right.fx = 260;
  EXPECT_TRUE(is_error(said(cameras, {}), {.field = "right fx", .value = "260"}));
  cameras = pair_of_cameras();
  cameras.left.distortion_model = libmap::DistortionModel::radial_tangential;
  cameras.left.distortion = {0.1, 0, 0, 0};
  EXPECT_TRUE(is_error(said(cameras, {}), {.field = "left camera"}));
  cameras = pair_of_cameras();
  cameras.right.width = 100;
  EXPECT_TRUE(is_error(said(cameras, {}),
                       {.field = "right image", .value = "200 x 120", .bound = "100 x 120"}));
  StereoDepthOptions options;
  options.block_px = 4;
  EXPECT_TRUE(is_error(said(pair_of_cameras(), options), {.field = "block_px", .value = "4"}));
  options = {};
  options.disparities_px = 0;
  EXPECT_TRUE(is_error(said(pair_of_cameras(), options),
                       {.field = "disparities_px", .value = "0", .bound = ">= 16 and <= 1024"}));
  // More disparities than the image has columns is no reason to fail.
  options.disparities_px = 1024;
  EXPECT_EQ(stereo_depth(image, image, pair_of_cameras(), options).width, width);
}

}  // namespace stereo_depth_test
