// RGB-D frame: color and depth images and cameras of one node of a scan.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// A rectified pair: the right camera is at `baseline_m` on the x axis of the left camera.
struct StereoCamera {
  Camera left;
  Camera right;
  double baseline_m = 0.0;
  Pose right_from_left = Pose::Identity();
};

// Color and depth images of one or several cameras. Images of several cameras are side by side in
// one image, with equal widths and in the order of `cameras`. Depth (m) is registered to the color
// camera and may have a different size.
struct RgbdFrame {
  int node = 0;
  double stamp_s = 0.0;
  double depth_stamp_offset_s = 0.0;  // stamp of depth minus stamp of color, if both are known
  std::vector<Camera> cameras;  // of the color images; of the depth images if there is no color
  ColorImage color;             // empty if not stored or not requested
  DepthImage depth;
  GrayImage right;  // right image of a stereo pair
  std::vector<StereoCamera> stereo;
};

// One camera's part of a frame.
struct CameraView {
  Camera color_camera;
  // color_camera at the size of `depth`; the principal point is scaled with the size, as in
  // RTAB-Map.
  Camera depth_camera;
  ColorImage color;
  DepthImage depth;
};

// Splits a frame by camera; empty without cameras. Throws Error naming the node if the image width
// is not a multiple of the number of cameras.
std::vector<CameraView> camera_views(const RgbdFrame& frame);

// Returns the number of pixels of the largest of: all cameras, the color image, the depth image.
std::size_t image_pixels(const RgbdFrame& frame);

// Returns the number of frames to keep in memory at a time: 8 of up to 2 megapixels, fewer of
// larger ones, at least 1. It does not depend on the number of threads, because results must not.
std::size_t frames_in_batch(std::size_t max_image_pixels);

}  // namespace libmap
