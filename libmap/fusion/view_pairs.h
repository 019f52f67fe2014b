// Compares depth and color of two views of a surface at a given relative pose.
#pragma once

#include <vector>

#include "libmap/core/pose.h"
#include "libmap/fusion/surface_refinement.h"

namespace libmap {

// One entry per sampled pixel of the first view; NaN: the second view measured nothing there.
struct ViewComparison {
  std::vector<Eigen::Vector3f> points;  // in the first camera's frame; 0 without depth, never NaN
  std::vector<float> depth;             // (measured - expected depth) / expected depth
  std::vector<float> color;             // 1 - correlation of the brightness of 5 x 5 pixels
};

// Compares about 2000 pixels of `from`, sampled on a grid, with `onto`. An entry of `color` is NaN
// also without texture, at a depth jump, or if the absolute value of `depth` is above `gate`.
ViewComparison compare_views(const RefinementView& from, const RefinementView& onto,
                             const Pose& onto_from, float gate);

}  // namespace libmap
