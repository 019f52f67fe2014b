// Support for the tests of the regression plane.
#pragma once

#include <Eigen/Core>

#include "libgtd/terrain/regression_plane.h"

namespace regression_plane_test {

// Returns the axes of the terrain frame as columns, in the input frame.
inline Eigen::Matrix3d axes_of(const libgtd::RegressionPlane& plane) {
  return plane.terrain_from_input.linear().transpose();
}

inline libgtd::RegressionPlaneOptions upwards(
    const Eigen::Vector3d& up, libgtd::PlaneMethod method = libgtd::PlaneMethod::robust) {
  return {.method = method, .up = up};
}

}  // namespace regression_plane_test
