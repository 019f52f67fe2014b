// Samples of a frame's surfaces, in its base.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/features/features.h"

namespace libmap {

struct BaseElement {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double noise_m = 0.0;  // standard deviation along the normal
  double range_m = 0.0;  // along the optical axis
};

// One in ten patches of each depth image serves for checks alone: no pose is estimated from what it
// shows.
enum class SampleUse { estimation, checks };

// About `count` elements, evenly over the pictures.
std::vector<BaseElement> surface_samples(const FrameFeatures& frame, int count, SampleUse use);

// The element of the frame's surfaces that lies where its cameras see the point; false where none
// does.
bool seen_from_base(const FrameFeatures& frame, const Eigen::Vector3d& point_in_base,
                    BaseElement& element);

}  // namespace libmap
