// Where the texts beside points go, so that they can be read.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/view/scene_camera.h"

namespace libmap {

struct LabelRequest {
  Eigen::Vector2d anchor = Eigen::Vector2d::Zero();  // pixel of the point
  double width_px = 0.0;
  double height_px = 0.0;
};

// A box for each request, in their order: beside its point if there is room, else further out; on
// no other point, on no other box and inside `bounds` wherever that is possible, else where the
// least is covered. `point_radius_px` is what is kept free around every point.
std::vector<PixelRect> place_labels(const std::vector<LabelRequest>& requests,
                                    double point_radius_px, const PixelRect& bounds);

}  // namespace libmap
