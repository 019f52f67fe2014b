// Samples planes from a frame's depth images, in the base frame, for ICP and the evaluation of ICP.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/features/features.h"

namespace libmap {

// Small plane of a DepthSurface, in the base frame (m).
struct PlacedElement {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit, towards the camera
  double noise_m = 0.0;                              // standard deviation along the normal
  double range_m = 0.0;                              // depth along the optical axis
};

// One in ten blocks of 6 x 6 grid cells of a depth image is only for checks, not for estimation.
enum class SampleUse { estimation, checks };

// Returns about `count` planes, evenly distributed over the frame's images.
std::vector<PlacedElement> surface_samples(const FrameFeatures& frame, int count, SampleUse use);

// Finds the plane at the projection of the point, in the first camera that has a plane there.
// Returns false if no camera has a plane there.
bool element_at(const FrameFeatures& frame, const Eigen::Vector3d& point_in_base,
                PlacedElement& element);

}  // namespace libmap
