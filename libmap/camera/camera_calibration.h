// Calibration of a camera by pictures of a chessboard (Zhang 2000), by OpenCV.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"

namespace libmap {

// Inner corners, where four squares meet: a board of 9 x 7 squares has 8 x 6.
struct Chessboard {
  int columns = 8;          // >= 3
  int rows = 6;             // >= 3
  double square_mm = 30.0;  // > 0
};

// "8x6". Throws Error naming `field`.
Chessboard parse_chessboard(const std::string& text, const std::string& field);

// What the lens does: nothing; k1 k2 p1 p2 k3; these and k4 k5 k6; a fisheye's k1 to k4.
enum class LensModel { none, plumb_bob, rational, equidistant };
std::vector<std::pair<std::string, LensModel>> lens_model_names();

// Row by row, to a fraction of a pixel; pixel centers have whole coordinates. Nothing if the image
// does not show all of the board. Which end of the board comes first is not said.
std::optional<std::vector<Eigen::Vector2d>> find_chessboard(const GrayImage& image,
                                                            const Chessboard& board);

// The corners in the board's frame, m, in the order of find_chessboard: x along the rows, y along
// the columns, from the first corner on.
std::vector<Eigen::Vector3d> corners_on_board(const Chessboard& board);

// Where the board is to a camera (optical frame) that sees its corners along these rays, x/z and
// y/z: camera_from_board by IPPE (Collins and Bartoli 2014). Nothing if no pose explains them.
std::optional<Pose> locate_chessboard(const std::vector<Eigen::Vector2d>& rays,
                                      const Chessboard& board);

// Infrared pictures use few of their 16 bits: from the 1st to the 99th percentile, stretched.
GrayImage stretch_contrast(const Image<std::uint16_t>& image);

// The board in one picture.
struct BoardPicture {
  std::string name{};
  std::vector<Eigen::Vector2d> corners{};  // as of find_chessboard
};

struct CameraCalibrationOptions {
  Chessboard board{};
  LensModel lens = LensModel::plumb_bob;
  // Pictures with a larger error are left out, and the rest is calibrated anew; 0: none is.
  double max_picture_error_px = 0.0;
};
void bind(ParameterTable& table, CameraCalibrationOptions& options);  // all but board's corners

struct CalibratedPicture {
  std::string name{};
  Pose camera_from_board = Pose::Identity();  // board: as corners_on_board
  double rms_px = 0.0;                        // of the distances in the image
  double max_px = 0.0;
  double tilt_deg = 0.0;  // between the board's normal and the optical axis
  std::vector<Eigen::Vector2d> corners{};
  std::vector<Eigen::Vector2d> residuals_px{};  // found minus projected
};

struct CameraCalibrationResult {
  Camera camera{};
  // Standard deviations, by the noise that the residuals show, in the order fx fy cx cy, then the
  // lens's own terms as `camera.distortion`.
  std::vector<double> deviations{};
  double rms_px = 0.0;               // over all corners
  double sigma_px = 0.0;             // noise of one coordinate of a corner
  double corners_width_share = 0.0;  // how much of the image's width and height the corners span
  double corners_height_share = 0.0;
  std::vector<CalibratedPicture> pictures{};
  std::vector<std::string> rejected{};  // above max_picture_error_px
  std::vector<std::string> repeated{};  // show the board where an earlier picture does

  // fx's or fy's standard deviation by its value, whichever is larger.
  double relative_focal_deviation() const;
};

// Pictures whose corners lie within 1 px (root mean square) of an earlier one's are left out: their
// errors are not independent. Throws Error: fewer than 3 pictures are left,
// pictures that do not determine the camera (for instance all seen straight on).
CameraCalibrationResult calibrate_camera(const std::vector<BoardPicture>& pictures, int width,
                                         int height, const CameraCalibrationOptions& options = {});

}  // namespace libmap
