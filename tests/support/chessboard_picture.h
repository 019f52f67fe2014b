// Pictures of a chessboard by a camera that is known exactly.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace graspmap_test {

struct PaintedBoard {
  int columns = 8;  // inner corners
  int rows = 6;
  double square_m = 0.03;
};

// The first inner corner lies at the board's origin, x along the rows, y along the columns; a white
// margin of one square goes around.
class ChessboardPainter {
 public:
  // `samples` x `samples` rays a pixel.
  ChessboardPainter(const libmap::Camera& camera, int samples);

  // Intensities 0 to 255. What is not board is gray.
  libmap::Image<float> paint(const PaintedBoard& board,
                             const libmap::Pose& camera_from_board) const;

  // Where the inner corners are, row by row.
  std::vector<Eigen::Vector2d> corners(const PaintedBoard& board,
                                       const libmap::Pose& camera_from_board) const;

 private:
  libmap::Camera camera_;
  int samples_;
  std::vector<Eigen::Vector2d> rays_;
};

// Boards in front of the camera, tilted by up to `max_tilt_deg` about any axis, all corners at
// least `margin_px` inside the image; drawn from random_engine().
std::vector<libmap::Pose> board_poses(const libmap::Camera& camera, const PaintedBoard& board,
                                      int count, double max_tilt_deg, double margin_px = 12);

// A Gaussian blur of `blur_px`, then Gaussian noise of `noise` gray levels, then rounding.
libmap::GrayImage photographed(const libmap::Image<float>& picture, double blur_px, double noise);

}  // namespace graspmap_test
