// Adjusts a camera and the poses of calibration boards by least squares, for camera_calibration.h.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

struct BoardFit {
  Camera camera{};
  std::vector<Pose> camera_from_board{};  // one per image
};

struct BoardCorners {
  std::vector<Eigen::Vector3d> in_board{};                // m
  std::vector<std::vector<Eigen::Vector2d>> in_images{};  // px, one list per image
};

// Projects a corner (m, board frame) into the image, px; NaN behind the camera.
Eigen::Vector2d board_pixel(const Camera& camera, const Pose& camera_from_board,
                            const Eigen::Vector3d& corner);

// Sum of squared distances between corners and projections, px^2; NaN if one is behind the camera.
double squared_error(const BoardFit& fit, const BoardCorners& corners);

// Optimizes intrinsics and board poses to a local minimum of the squared error (Ceres:
// Levenberg-Marquardt with the boards eliminated). Returns the squared error.
double adjust_boards(BoardFit& fit, const BoardCorners& corners);

// Covariance of the intrinsics (fx fy cx cy and distortion terms) for a noise of 1 px in each
// coordinate, with the board poses marginalized. Empty if the corners do not determine the camera.
Eigen::MatrixXd unit_covariance(const BoardFit& fit, const BoardCorners& corners);

}  // namespace libmap
