// Computes depth from rectified stereo images by semi-global matching (Hirschmueller 2008, OpenCV).
#pragma once

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"

namespace libmap {

// Number of directions along which matching costs are summed; more directions smooth more.
enum class StereoDirections { three, five, eight };

struct StereoDepthOptions {
  int min_disparity_px = 0;     // < 0 only for converging cameras
  int disparities_px = 128;     // range of disparities, 16 to 1024, rounded up to a multiple of 16
  int block_px = 5;             // side of the matched window, odd, 1 to 31
  int uniqueness_percent = 10;  // 0 to 100: minimum margin from best to second cost, % of second
  int left_right_px = 1;  // maximum disparity difference in the left-right check; -1: no check
  int speckle_px = 100;   // minimum pixels of a connected patch of similar disparity; 0: no limit
  int min_contrast = 2;   // minimum range of gray levels in the left image's window, because
                          // uniform areas, such as overexposed ones, match anywhere
  StereoDirections directions = StereoDirections::five;
  double max_depth_m = 0.0;  // larger depths are dropped; 0: no limit
};
void bind(ParameterTable& table, StereoDepthOptions& options);

// Returns the depth of the left image's pixels, m; 0 without a match. z = fx b / (d - (cx_left -
// cx_right)) with the focal length fx, the baseline b, the disparity d = x_left - x_right and the
// principal points cx. Throws Error naming the field if an image does not have the size of its
// camera, the cameras are not rectified (distorted, or with different fx), the baseline is not > 0,
// or an option is out of range.
DepthImage stereo_depth(const GrayImage& left, const GrayImage& right, const StereoCamera& cameras,
                        const StereoDepthOptions& options = {});

// Returns the depth images of a frame's stereo pairs, side by side like the frame's images. Throws
// Error naming the node if the frame has no stereo pair or no images, or as for one pair.
DepthImage stereo_depth(const RgbdFrame& frame, const StereoDepthOptions& options = {});

// Returns the 8-bit luminance by ITU-R BT.601.
GrayImage luminance(const ColorImage& image);

}  // namespace libmap
