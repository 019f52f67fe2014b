// Stores an RGB-D frame (color and depth images and cameras of a node), and splits it by camera.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// A stereo pair. In a rectified pair, right_from_left is a translation by -baseline_m along x.
struct StereoCamera {
  Camera left;
  Camera right;
  double baseline_m = 0.0;  // > 0: distance between the cameras
  Pose right_from_left = Pose::Identity();
};

// Color and depth images of one or several cameras. Images of several cameras are side by side in
// one image, with equal widths and in the order of `cameras`. Depth (z, m; 0: no measurement) is
// registered to the color camera and may have another size.
struct RgbdFrame {
  int node = 0;                       // id of the node in the scan
  double stamp_s = 0.0;               // stamp of the node
  double depth_stamp_offset_s = 0.0;  // stamp of depth minus stamp of color; 0 if unknown
  std::vector<Camera> cameras;  // of the color images; of the depth images if there is no color
  ColorImage color;             // empty if not stored or not requested
  DepthImage depth;             // empty if not stored or not requested
  GrayImage right;              // right images of stereo pairs, side by side
  std::vector<StereoCamera> stereo;  // empty without stereo; left cameras are also in `cameras`
};

// A camera of a frame with its part of the images.
struct CameraView {
  Camera color_camera;
  // color_camera with focal lengths and principal point scaled to the size of `depth`.
  Camera depth_camera;
  ColorImage color;
  DepthImage depth;
};

// Returns one view per camera of a frame, in the order of `cameras`. Throws Error naming the node
// if an image's width is not a multiple of the number of cameras.
std::vector<CameraView> camera_views(const RgbdFrame& frame);

// Returns the largest number of pixels: of color image, depth image, or all cameras together.
std::size_t image_pixels(const RgbdFrame& frame);

// Returns the number of frames to keep in memory at a time: 8 of up to 2 megapixels, fewer of
// larger ones, at least 1. It does not depend on the number of threads, because results must not.
std::size_t frames_in_batch(std::size_t max_image_pixels);

}  // namespace libmap
