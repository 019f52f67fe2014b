// Depth from a rectified pair of images, by semi-global matching (Hirschmueller 2008) of OpenCV.
#pragma once

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"

namespace libmap {

// Along how many directions the matching costs are summed: more are slower and smoother.
enum class StereoDirections { three, five, eight };

struct StereoDepthOptions {
  int min_disparity_px = 0;     // < 0 only where the cameras squint
  int disparities_px = 128;     // 16 to 1024, rounded up to a multiple of 16
  int block_px = 5;             // odd, 1 to 31: side of the matched window
  int uniqueness_percent = 10;  // by which the best match must beat the next; 0 to 100
  int left_right_px = 1;        // by which both directions of matching may differ; -1: not asked
  int speckle_px = 100;         // smaller patches of their own disparity are dropped; 0: none
  int min_contrast = 2;  // gray levels between darkest and brightest pixel of the left window; 0 to
                         // 255: what is blank, such as an overexposed patch, matches anything
  StereoDirections directions = StereoDirections::five;
  double max_depth_m = 0.0;  // >= 0: what lies beyond is dropped; 0: no limit
};
void bind(ParameterTable& table, StereoDepthOptions& options);

// Depth of the left image's pixels, meters, 0 where no match was found:
// z = fx b / (d - (cx_left - cx_right)), d the disparity x_left - x_right. Throws Error naming the
// field: images not of the cameras' sizes, cameras that are not rectified
// (distorted, or with different fx), no baseline, options out of their ranges.
DepthImage stereo_depth(const GrayImage& left, const GrayImage& right, const StereoCamera& cameras,
                        const StereoDepthOptions& options = {});

// The depth of a frame that has a pair of images and no depth; several pairs stand side by side as
// the frame's images do. Throws Error naming the node if the frame has no pair.
DepthImage stereo_depth(const RgbdFrame& frame, const StereoDepthOptions& options = {});

// 8-bit luminance, ITU-R BT.601.
GrayImage luminance(const ColorImage& image);

}  // namespace libmap
