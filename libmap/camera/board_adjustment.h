// Least squares of a camera and the boards in front of it: the inner part of camera_calibration.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

struct BoardFit {
  Camera camera{};
  std::vector<Pose> camera_from_board{};  // one per picture
};

struct BoardCorners {
  std::vector<Eigen::Vector3d> in_board{};                // m
  std::vector<std::vector<Eigen::Vector2d>> in_images{};  // px, one list per picture
};

// NaN behind the camera.
Eigen::Vector2d board_pixel(const Camera& camera, const Pose& camera_from_board,
                            const Eigen::Vector3d& corner);

// Sum of the squared distances between the corners and their projections, px^2.
double squared_error(const BoardFit& fit, const BoardCorners& corners);

// Moves the camera's intrinsics and the boards to the local minimum of the squared error (Ceres:
// Levenberg-Marquardt, the boards eliminated). Returns that error.
double adjust_boards(BoardFit& fit, const BoardCorners& corners);

// Covariance of the intrinsics (fx fy cx cy and the lens's terms) for a noise of 1 px in each
// coordinate, whatever the boards' poses are. Empty where the pictures do not determine them.
Eigen::MatrixXd unit_covariance(const BoardFit& fit, const BoardCorners& corners);

}  // namespace libmap
