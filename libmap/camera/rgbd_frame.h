// What one node of a scan has recorded.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// A rectified pair: the right camera lies `baseline_m` along the left one's x axis.
struct StereoCamera {
  Camera left;
  Camera right;
  double baseline_m = 0.0;
  Pose right_from_left = Pose::Identity();
};

// Color and depth of one or several cameras; several stand side by side in one image, each with
// the same share of its width, in the order of `cameras`. Depth is registered to the color camera,
// and may have another size than color.
struct RgbdFrame {
  int node = 0;
  double stamp_s = 0.0;
  double depth_later_s = 0.0;   // stamp of depth after that of color, where both have one
  std::vector<Camera> cameras;  // of the color images; of the depth images where there is no color
  ColorImage color;             // empty if not stored or not asked for
  DepthImage depth;
  GrayImage right;  // of a stereo pair
  std::vector<StereoCamera> stereo;
};

// One camera's part of a frame.
struct CameraView {
  Camera color_camera;
  // color_camera at the size of `depth`; the principal point goes with the size, as in RTAB-Map.
  Camera depth_camera;
  ColorImage color;
  DepthImage depth;
};

// The frame cut into its cameras. Throws Error naming the node if the image does not fit them.
std::vector<CameraView> camera_views(const RgbdFrame& frame);

// Pixels of the frame's cameras, or of its depth image where that has more.
std::size_t image_pixels(const RgbdFrame& frame);

// How many frames are held in memory side by side: by their size, not by the number of threads,
// which results must not depend on. 8 of up to 2 megapixels each, fewer of larger ones, at least 1.
std::size_t frames_in_batch(std::size_t max_image_pixels);

}  // namespace libmap
