// Renders images of a chessboard by an exactly known camera.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace graspmap_test {

struct PaintedBoard {
  int columns = 8;  // inner corners per row
  int rows = 6;     // inner corners per column
  double square_m = 0.03;
};

// Paints a board with a white margin of one square. The first inner corner is the board's origin; x
// is along the rows, y along the columns.
class ChessboardPainter {
 public:
  // Uses `samples` x `samples` rays per pixel.
  ChessboardPainter(const libmap::Camera& camera, int samples);

  // Returns intensities 0 to 255; the background is gray.
  libmap::Image<float> paint(const PaintedBoard& board,
                             const libmap::Pose& camera_from_board) const;

  // Returns the pixel positions of the inner corners, row by row.
  std::vector<Eigen::Vector2d> corners(const PaintedBoard& board,
                                       const libmap::Pose& camera_from_board) const;

 private:
  libmap::Camera camera_;
  int samples_;
  std::vector<Eigen::Vector2d> rays_;
};

// Returns random poses of boards in front of the camera, drawn from random_engine(), tilted by up
// to `max_tilt_deg` about any axis, with all corners at least `margin_px` inside the image.
std::vector<libmap::Pose> board_poses(const libmap::Camera& camera, const PaintedBoard& board,
                                      int count, double max_tilt_deg, double margin_px = 12);

// Applies a Gaussian blur (sigma `blur_px`), Gaussian noise of `noise` gray levels, and rounding.
libmap::GrayImage photographed(const libmap::Image<float>& photo, double blur_px, double noise);

}  // namespace graspmap_test
