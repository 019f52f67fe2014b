// Calibrates a camera from images of a chessboard (Zhang 2000).
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

// Chessboard, measured in inner corners: a board of 9 x 7 squares has 8 x 6 corners.
struct Chessboard {
  int columns = 8;          // 3 to 100: corners per row
  int rows = 6;             // 3 to 100: rows of corners
  double square_mm = 30.0;  // > 0: side of a square
};

// Parses columns and rows such as "8x6". Throws Error naming `field` unless both are 3 to 100.
Chessboard parse_chessboard(const std::string& text, const std::string& field);

// Terms of lens distortion, in order. none: no terms; plumb_bob: k1 k2 p1 p2 k3; rational: k1 k2 p1
// p2 k3 k4 k5 k6; equidistant (fisheye lens): k1 k2 k3 k4.
enum class LensModel { none, plumb_bob, rational, equidistant };
std::vector<std::pair<std::string, LensModel>> lens_model_names();

// Returns the corners of a chessboard with subpixel accuracy, row by row, px; centers of pixels
// have integer coordinates. Returns nullopt if a part of the board is not visible. The first corner
// may be at either end of the board, because the board's orientation is ambiguous.
std::optional<std::vector<Eigen::Vector2d>> find_chessboard(const GrayImage& image,
                                                            const Chessboard& board);

// Returns the corners in the board frame, m, in the order of find_chessboard: x along the rows, y
// along the columns, origin at the first corner.
std::vector<Eigen::Vector3d> corners_on_board(const Chessboard& board);

// Returns camera_from_board (optical frame) from the rays (x/z, y/z) to the corners in the order of
// find_chessboard, by IPPE (Collins and Bartoli 2014); nullopt if there is no valid pose.
std::optional<Pose> locate_chessboard(const std::vector<Eigen::Vector2d>& rays,
                                      const Chessboard& board);

// Maps gray values linearly to 8 bits: the 1st percentile to 0, the 99th to 255.
GrayImage stretch_contrast(const Image<std::uint16_t>& image);

// The board in one image.
struct BoardImage {
  std::string name{};
  std::vector<Eigen::Vector2d> corners{};  // result of find_chessboard
};

struct CameraCalibrationOptions {
  Chessboard board{};
  LensModel lens = LensModel::plumb_bob;
  // Limit of the RMS reprojection error. While an image exceeds the limit, the worst image is
  // rejected and the calibration repeated; 0: no limit.
  double max_image_error_px = 0.0;
};
// Binds all fields except board.columns and board.rows.
void bind(ParameterTable& table, CameraCalibrationOptions& options);

struct CalibratedImage {
  std::string name{};
  Pose camera_from_board = Pose::Identity();    // board frame: as in corners_on_board
  double rms_px = 0.0;                          // RMS length of the residuals
  double max_px = 0.0;                          // maximum length of a residual
  double tilt_deg = 0.0;                        // angle between board normal and optical axis
  std::vector<Eigen::Vector2d> corners{};       // detected corners, px
  std::vector<Eigen::Vector2d> residuals_px{};  // detected minus projected corners
};

struct CameraCalibrationResult {
  Camera camera{};
  // Standard deviations of fx fy cx cy and camera.distortion, if corners have noise of sigma_px.
  std::vector<double> deviations{};
  double rms_px = 0.0;           // RMS distance between detected and projected corners
  double sigma_px = 0.0;         // standard deviation of a corner in x and y, from the residuals
  double width_coverage = 0.0;   // range of all corners' x as a fraction of the image width
  double height_coverage = 0.0;  // range of all corners' y as a fraction of the image height
  std::vector<CalibratedImage> images{};  // images that determine the result
  std::vector<std::string> rejected{};    // above max_image_error_px, or inconsistent with others
  std::vector<std::string> repeated{};    // ignored images that show the corners of earlier images

  // Relative standard deviation of fx or fy, whichever is larger.
  double relative_focal_deviation() const;
};

// Calibrates the camera. Images whose corners are within 1 px (RMS) of an earlier image are
// ignored, because their errors are not independent. Throws Error if fewer than 3 images remain, or
// if the images do not determine the camera, for example because all boards are seen frontally.
CameraCalibrationResult calibrate_camera(const std::vector<BoardImage>& images, int width,
                                         int height, const CameraCalibrationOptions& options = {});

}  // namespace libmap
