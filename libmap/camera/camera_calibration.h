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

// Size of a chessboard in inner corners: a board of 9 x 7 squares has 8 x 6.
struct Chessboard {
  int columns = 8;          // 3 to 100
  int rows = 6;             // 3 to 100
  double square_mm = 30.0;  // > 0
};

// Parses columns and rows such as "8x6". Throws Error naming `field` if they are out of range.
Chessboard parse_chessboard(const std::string& text, const std::string& field);

// Distortion: none; k1 k2 p1 p2 k3; k1 k2 p1 p2 k3 k4 k5 k6; k1 to k4 of a fisheye lens.
enum class LensModel { none, plumb_bob, rational, equidistant };
std::vector<std::pair<std::string, LensModel>> lens_model_names();

// Detects the corners with subpixel accuracy, row by row, px; pixel centers have integer
// coordinates. Returns nullopt unless the complete board is visible. The board's orientation is
// ambiguous: the first detected corner can be at the other end of the board.
std::optional<std::vector<Eigen::Vector2d>> find_chessboard(const GrayImage& image,
                                                            const Chessboard& board);

// Corners in the board frame, m, in the order of find_chessboard: x along the rows, y along the
// columns, origin at the first corner.
std::vector<Eigen::Vector3d> corners_on_board(const Chessboard& board);

// Returns camera_from_board (optical frame) from the rays (x/z, y/z) to the corners, by IPPE
// (Collins and Bartoli 2014); nullopt if there is no valid pose.
std::optional<Pose> locate_chessboard(const std::vector<Eigen::Vector2d>& rays,
                                      const Chessboard& board);

// Maps the range from the 1st to the 99th percentile to 8 bits, for 16-bit infrared images.
GrayImage stretch_contrast(const Image<std::uint16_t>& image);

// The board in one image.
struct BoardImage {
  std::string name{};
  std::vector<Eigen::Vector2d> corners{};  // result of find_chessboard
};

struct CameraCalibrationOptions {
  Chessboard board{};
  LensModel lens = LensModel::plumb_bob;
  // Images with a larger RMS error are rejected, and calibration is repeated; 0: no limit.
  double max_image_error_px = 0.0;
};
// Binds all fields except the number of corners.
void bind(ParameterTable& table, CameraCalibrationOptions& options);

struct CalibratedImage {
  std::string name{};
  Pose camera_from_board = Pose::Identity();    // board frame: as in corners_on_board
  double rms_px = 0.0;                          // RMS of the residuals' lengths
  double max_px = 0.0;                          // maximum length of a residual
  double tilt_deg = 0.0;                        // angle of the board's normal to the optical axis
  std::vector<Eigen::Vector2d> corners{};       // detected corners, px
  std::vector<Eigen::Vector2d> residuals_px{};  // detected minus projected corners
};

struct CameraCalibrationResult {
  Camera camera{};
  // Standard deviations of fx fy cx cy and the terms of `camera.distortion`, for the noise
  // estimated from the residuals.
  std::vector<double> deviations{};
  double rms_px = 0.0;          // RMS distance between detected and projected corners
  double sigma_px = 0.0;        // standard deviation of one coordinate of a corner
  double width_coverage = 0.0;  // fraction of the image's width and height spanned by the corners
  double height_coverage = 0.0;
  std::vector<CalibratedImage> images{};
  std::vector<std::string> rejected{};  // images above max_image_error_px or inconsistent
  std::vector<std::string> repeated{};  // duplicates of earlier images

  // Relative standard deviation of fx or fy, whichever is larger.
  double relative_focal_deviation() const;
};

// Calibrates the camera. Images with corners within 1 px (RMS) of an earlier image are ignored,
// because their errors are not independent. Throws Error if fewer than 3 images remain, or if they
// do not determine the camera, for example because all boards are seen frontally.
CameraCalibrationResult calibrate_camera(const std::vector<BoardImage>& images, int width,
                                         int height, const CameraCalibrationOptions& options = {});

}  // namespace libmap
