// Adjusts a camera and the poses of calibration boards by least squares, for camera_calibration.h.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

struct BoardFit {
  Camera camera{};
  std::vector<Pose> camera_from_board{};  // one per image; camera: optical frame
};

struct BoardCorners {
  std::vector<Eigen::Vector3d> in_board{};                // corners in the board frame, m
  std::vector<std::vector<Eigen::Vector2d>> in_images{};  // detected corners of each image, px
};

// Projects a corner (board frame, m) into the image, px; NaN if the corner is behind the camera.
Eigen::Vector2d board_pixel(const Camera& camera, const Pose& camera_from_board,
                            const Eigen::Vector3d& corner);

// Returns the sum of squared reprojection errors, px^2; NaN if a corner is behind the camera.
double squared_error(const BoardFit& fit, const BoardCorners& corners);

// Optimizes intrinsics and board poses of `fit` to a local minimum of squared_error (Ceres:
// Levenberg-Marquardt with DENSE_SCHUR). Returns the squared error.
double adjust_boards(BoardFit& fit, const BoardCorners& corners);

// Returns the covariance of the intrinsics (fx fy cx cy, distortion terms) if the detected corners
// have a standard deviation of 1 px in x and y. Empty if the corners do not determine the camera.
Eigen::MatrixXd unit_covariance(const BoardFit& fit, const BoardCorners& corners);

}  // namespace libmap
