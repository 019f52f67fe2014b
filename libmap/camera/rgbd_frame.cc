#include "libmap/camera/rgbd_frame.h"

#include <algorithm>
#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

// Width of one of `count` images side by side.
int part_width(int node, const std::string& what, int width, std::size_t count) {
  const int cameras = static_cast<int>(count);
  if (width % cameras != 0)
    throw Error("images of several cameras, side by side, must have equal widths",
                {.field = "node " + std::to_string(node) + ": " + what + " width",
                 .value = std::to_string(width),
                 .bound = "a multiple of " + std::to_string(cameras)});
  return width / cameras;
}

// The camera at another image size. RTAB-Map downsamples images by taking every n-th pixel and
// scales the principal point with the size: pixels are samples, not areas. This was verified on a
// database with color at half the size of depth; pixels as areas shift the surface by 4.5 mm.
Camera downsampled_camera(Camera camera, int width, int height) {
  const double sx = static_cast<double>(width) / camera.width;
  const double sy = static_cast<double>(height) / camera.height;
  camera.width = width;
  camera.height = height;
  camera.fx *= sx;
  camera.cx *= sx;
  camera.fy *= sy;
  camera.cy *= sy;
  return camera;
}

}  // namespace

std::vector<CameraView> camera_views(const RgbdFrame& frame) {
  std::vector<CameraView> views;
  if (frame.cameras.empty()) return views;
  const std::size_t count = frame.cameras.size();
  const int color_width = part_width(frame.node, "color image", frame.color.width, count);
  const int depth_width = part_width(frame.node, "depth image", frame.depth.width, count);
  for (std::size_t i = 0; i < count; ++i) {
    CameraView view;
    view.color_camera = frame.cameras[i];
    const int index = static_cast<int>(i);
    if (!frame.color.empty()) {
      view.color =
          count == 1 ? frame.color : crop_columns(frame.color, index * color_width, color_width);
      if (view.color.width != view.color_camera.width ||
          view.color.height != view.color_camera.height)
        view.color_camera =
            downsampled_camera(view.color_camera, view.color.width, view.color.height);
    }
    view.depth_camera = view.color_camera;
    if (!frame.depth.empty()) {
      view.depth =
          count == 1 ? frame.depth : crop_columns(frame.depth, index * depth_width, depth_width);
      if (view.depth.width != view.depth_camera.width ||
          view.depth.height != view.depth_camera.height)
        view.depth_camera =
            downsampled_camera(view.depth_camera, view.depth.width, view.depth.height);
    }
    views.push_back(std::move(view));
  }
  return views;
}

namespace {

constexpr std::size_t max_frames = 8;
constexpr std::size_t batch_pixels = std::size_t{1} << 24;

}  // namespace

std::size_t image_pixels(const RgbdFrame& frame) {
  std::size_t pixels = 0;
  for (const Camera& camera : frame.cameras)
    pixels += static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  return std::max({pixels, frame.color.pixels.size(), frame.depth.pixels.size()});
}

std::size_t frames_in_batch(std::size_t max_image_pixels) {
  return std::clamp<std::size_t>(batch_pixels / std::max<std::size_t>(max_image_pixels, 1), 1,
                                 max_frames);
}

}  // namespace libmap
