#include "libmap/camera/camera_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "libmap/camera/board_adjustment.h"
#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr std::size_t min_images = 3;
constexpr int min_side = 3;  // corners
constexpr int max_side = 100;
constexpr double same_point_px = 1.0;
// Maximum relative standard deviation of the focal length for a determined camera.
constexpr double max_relative_deviation = 0.2;

using Points2 = std::vector<cv::Point2f>;
using Points3 = std::vector<cv::Point3f>;

std::size_t corner_count(const Chessboard& board) {
  return static_cast<std::size_t>(board.columns) * static_cast<std::size_t>(board.rows);
}

std::size_t lens_terms(LensModel lens) {
  constexpr std::array<std::size_t, 4> terms = {0, 5, 8, 4};
  return terms[static_cast<std::size_t>(lens)];
}

Pose pose_of(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  cv::Mat r;
  cv::Mat t;
  rotation_vector.reshape(1, 3).convertTo(r, CV_64F);
  translation.reshape(1, 3).convertTo(t, CV_64F);
  const Eigen::Vector3d axis(r.at<double>(0), r.at<double>(1), r.at<double>(2));
  Pose pose = Pose::Identity();
  if (axis.norm() > 0)
    pose.linear() = Eigen::AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
  pose.translation() << t.at<double>(0), t.at<double>(1), t.at<double>(2);
  return pose;
}

[[noreturn]] void refuse_undetermined() {
  throw Error(
      "do not determine the camera; show the board at different tilts about both axes, some of 30 "
      "degrees and more",
      {.field = "images"});
}

DistortionModel distortion_of(LensModel lens) {
  if (lens == LensModel::none) return DistortionModel::none;
  return lens == LensModel::equidistant ? DistortionModel::equidistant
                                        : DistortionModel::radial_tangential;
}

BoardCorners corners_of(const std::vector<BoardImage>& images, const Chessboard& board) {
  BoardCorners corners;
  corners.in_board = corners_on_board(board);
  for (const BoardImage& image : images) corners.in_images.push_back(image.corners);
  return corners;
}

Points3 board_points(const std::vector<Eigen::Vector3d>& in_board) {
  Points3 points;
  for (const Eigen::Vector3d& corner : in_board)
    points.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()), 0.0F);
  return points;
}

std::optional<Pose> pose_by_rays(const std::vector<Eigen::Vector3d>& in_board,
                                 const std::vector<Eigen::Vector2d>& rays) {
  Points2 points;
  for (const Eigen::Vector2d& ray : rays)
    points.emplace_back(static_cast<float>(ray.x()), static_cast<float>(ray.y()));
  cv::Mat rotation;
  cv::Mat translation;
  if (!cv::solvePnP(board_points(in_board), points, cv::Mat::eye(3, 3, CV_64F), cv::noArray(),
                    rotation, translation, false, cv::SOLVEPNP_IPPE))
    return std::nullopt;
  return pose_of(rotation, translation);
}

// Estimates the pose of each board with a fixed camera. Returns nullopt if a corner has no ray.
std::optional<BoardFit> with_poses(const Camera& camera, const BoardCorners& corners) {
  BoardFit fit{camera, {}};
  for (const auto& in_image : corners.in_images) {
    std::vector<Eigen::Vector2d> rays;
    for (const Eigen::Vector2d& corner : in_image) {
      const auto ray = pixel_to_ray(camera, corner);
      if (!ray) return std::nullopt;
      rays.push_back(*ray);
    }
    const auto pose = pose_by_rays(corners.in_board, rays);
    if (!pose) return std::nullopt;
    fit.camera_from_board.push_back(*pose);
  }
  return fit;
}

// Squared error of each image; infinite if the board is behind the camera.
std::vector<double> image_errors(const BoardFit& fit, const BoardCorners& corners) {
  std::vector<double> errors;
  for (std::size_t n = 0; n < corners.in_images.size(); ++n) {
    const double error = squared_error({fit.camera, {fit.camera_from_board[n]}},
                                       {corners.in_board, {corners.in_images[n]}});
    errors.push_back(std::isfinite(error) ? error : std::numeric_limits<double>::infinity());
  }
  return errors;
}

// Sums squared errors over the best three quarters of the images, to be robust against bad ones.
double robust_error(const BoardFit& fit, const BoardCorners& corners) {
  std::vector<double> errors = image_errors(fit, corners);
  std::sort(errors.begin(), errors.end());
  const auto used = static_cast<std::ptrdiff_t>((3 * errors.size() + 3) / 4);
  return std::accumulate(errors.begin(), errors.begin() + used, 0.0);
}

// Tries many initial focal lengths of a camera without distortion.
BoardFit fit_from_many_starts(const BoardCorners& corners, int width, int height, LensModel lens) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.cx = (width - 1) / 2.0;
  camera.cy = (height - 1) / 2.0;
  camera.distortion_model = distortion_of(lens);
  camera.distortion.assign(lens_terms(lens), 0.0);
  std::vector<std::pair<double, BoardFit>> starts;
  for (double fraction = 0.2; fraction < 2.5; fraction *= 1.2) {
    camera.fx = camera.fy = fraction * width;
    const std::optional<BoardFit> fit = with_poses(camera, corners);
    if (!fit) continue;
    const double error = robust_error(*fit, corners);
    if (std::isfinite(error)) starts.emplace_back(error, *fit);
  }
  if (starts.empty()) refuse_undetermined();
  return std::min_element(starts.begin(), starts.end(),
                          [](const auto& a, const auto& b) { return a.first < b.first; })
      ->second;
}

BoardFit fit_camera(const BoardCorners& corners, int width, int height, LensModel lens) {
  try {
    BoardFit fit = fit_from_many_starts(corners, width, height, lens);
    const double error = adjust_boards(fit, corners);
    fit.camera.check();
    if (std::isfinite(error)) return fit;
  } catch (const cv::Exception&) {
  } catch (const Error&) {
  }
  refuse_undetermined();
}

CalibratedImage calibrated(const BoardImage& image, const Camera& camera, const Pose& pose,
                           const Chessboard& board) {
  CalibratedImage result;
  result.name = image.name;
  result.camera_from_board = pose;
  result.corners = image.corners;
  const std::vector<Eigen::Vector3d> in_board = corners_on_board(board);
  double sum = 0.0;
  for (std::size_t n = 0; n < image.corners.size(); ++n) {
    const Eigen::Vector2d residual = image.corners[n] - board_pixel(camera, pose, in_board[n]);
    result.residuals_px.push_back(residual);
    sum += residual.squaredNorm();
    result.max_px = std::max(result.max_px, residual.norm());
  }
  result.rms_px = std::sqrt(sum / static_cast<double>(image.corners.size()));
  const double cosine = std::min(1.0, std::abs(pose.linear()(2, 2)));
  result.tilt_deg = std::acos(cosine) * 180.0 / M_PI;
  return result;
}

void add_coverage(CameraCalibrationResult& result) {
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  for (const CalibratedImage& image : result.images)
    for (const Eigen::Vector2d& corner : image.corners) {
      low = low.min(corner.array());
      high = high.max(corner.array());
    }
  result.width_coverage = (high.x() - low.x()) / result.camera.width;
  result.height_coverage = (high.y() - low.y()) / result.camera.height;
}

// Returns true if both images show the same corners, in either order.
bool shows_the_same(const BoardImage& a, const BoardImage& b) {
  double forward = 0.0;
  double backward = 0.0;
  const std::size_t count = a.corners.size();
  for (std::size_t n = 0; n < count; ++n) {
    forward += (a.corners[n] - b.corners[n]).squaredNorm();
    backward += (a.corners[n] - b.corners[count - 1 - n]).squaredNorm();
  }
  return std::min(forward, backward) < static_cast<double>(count) * same_point_px * same_point_px;
}

CameraCalibrationResult calibrate_once(const std::vector<BoardImage>& images, int width, int height,
                                       const CameraCalibrationOptions& options) {
  if (images.size() < min_images)
    throw Error("too few distinct images of the board",
                {.field = "number of images",
                 .value = std::to_string(images.size()),
                 .bound = ">= " + std::to_string(min_images) + ", better 15 and more"});
  const BoardCorners corners = corners_of(images, options.board);
  const BoardFit fit = fit_camera(corners, width, height, options.lens);
  CameraCalibrationResult result;
  result.camera = fit.camera;
  double sum = 0.0;
  for (std::size_t n = 0; n < images.size(); ++n) {
    result.images.push_back(
        calibrated(images[n], fit.camera, fit.camera_from_board[n], options.board));
    for (const Eigen::Vector2d& residual : result.images.back().residuals_px)
      sum += residual.squaredNorm();
  }
  const auto count = static_cast<double>(images.size() * corner_count(options.board));
  // OpenCV's standard deviations neglect near-singular directions.
  const Eigen::MatrixXd covariance = unit_covariance(fit, corners);
  if (covariance.size() == 0) refuse_undetermined();
  const double unknowns =
      static_cast<double>(covariance.rows()) + 6.0 * static_cast<double>(images.size());
  result.rms_px = std::sqrt(sum / count);
  result.sigma_px = std::sqrt(sum / std::max(1.0, 2 * count - unknowns));
  for (Eigen::Index n = 0; n < covariance.rows(); ++n)
    result.deviations.push_back(result.sigma_px * std::sqrt(covariance(n, n)));
  if (!(result.relative_focal_deviation() <= max_relative_deviation)) refuse_undetermined();
  add_coverage(result);
  return result;
}

// Index of an image that is inconsistent with a camera that fits all others, for example because of
// wrongly ordered corners; nullopt if there is none.
std::optional<std::size_t> find_odd_image(const std::vector<BoardImage>& images, int width,
                                          int height, const CameraCalibrationOptions& options) {
  constexpr double times_the_median = 5.0;
  if (images.size() <= min_images) return std::nullopt;
  const BoardCorners corners = corners_of(images, options.board);
  const std::vector<double> errors =
      image_errors(fit_from_many_starts(corners, width, height, options.lens), corners);
  const auto worst = std::max_element(errors.begin(), errors.end());
  if (!(std::sqrt(*worst) > times_the_median * std::sqrt(median(errors)))) return std::nullopt;
  return static_cast<std::size_t>(worst - errors.begin());
}

cv::Mat as_mat(const GrayImage& image) {
  // OpenCV has no read-only images, but does not modify this one.
  return cv::Mat(image.height, image.width, CV_8UC1,
                 const_cast<std::uint8_t*>(image.pixels.data()));
}

// Corners with pixel accuracy; empty unless the complete board is visible.
Points2 coarse_corners(const cv::Mat& pixels, const Chessboard& board) {
  const cv::Size size(board.columns, board.rows);
  Points2 found;
  // Duda and Frese 2018 is robust to blur and noise; the older method detects boards at the border.
  const bool complete =
      cv::findChessboardCornersSB(pixels, size, found,
                                  cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE) ||
      cv::findChessboardCorners(
          pixels, size, found,
          cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
  if (!complete || found.size() != corner_count(board)) return {};
  return found;
}

// Refines corners: gradients around a corner are orthogonal to the direction from it (Foerstner
// 1987). On rendered boards this halves the mean error.
Points2 refine_corners(const cv::Mat& pixels, const Chessboard& board, Points2 corners) {
  if (corners.empty()) return corners;
  double spacing = std::numeric_limits<double>::infinity();
  const auto columns = static_cast<std::size_t>(board.columns);
  for (std::size_t n = 0; n < corners.size(); ++n) {
    if ((n + 1) % columns != 0) spacing = std::min(spacing, cv::norm(corners[n + 1] - corners[n]));
    if (n + columns < corners.size())
      spacing = std::min(spacing, cv::norm(corners[n + columns] - corners[n]));
  }
  const int reach = std::max(2, static_cast<int>(std::lround(0.4 * spacing)));
  cv::cornerSubPix(pixels, corners, cv::Size(reach, reach), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4));
  return corners;
}

}  // namespace

Chessboard parse_chessboard(const std::string& text, const std::string& field) {
  const std::size_t cross = text.find('x');
  const auto side = [&](const std::string& part) {
    const std::int64_t corners = parse_integer(part).value_or(0);
    return corners >= min_side && corners <= max_side ? static_cast<int>(corners) : 0;
  };
  const int columns = side(text.substr(0, cross));
  const int rows = cross == std::string::npos ? 0 : side(text.substr(cross + 1));
  if (columns == 0 || rows == 0)
    throw Error("not a board", {.field = field,
                                .value = text,
                                .bound = "COLUMNSxROWS inner corners, 3 to 100 each, e.g. 8x6"});
  Chessboard board;
  board.columns = columns;
  board.rows = rows;
  return board;
}

std::vector<std::pair<std::string, LensModel>> lens_model_names() {
  return {{"none", LensModel::none},
          {"plumb_bob", LensModel::plumb_bob},
          {"rational", LensModel::rational},
          {"equidistant", LensModel::equidistant}};
}

void bind(ParameterTable& table, CameraCalibrationOptions& options) {
  table.add("square_mm", options.board.square_mm, positive, "side of a chessboard square, mm");
  table.add("lens", options.lens, lens_model_names(),
            "distortion model; none; plumb_bob: k1 k2 p1 p2 k3; rational: k1 k2 p1 p2 k3 k4 k5 "
            "k6; equidistant: k1 k2 k3 k4 of a fisheye lens");
  table.add_former_key("max_picture_error_px", "max_image_error_px");
  table.add("max_image_error_px", options.max_image_error_px, not_negative,
            "maximum RMS reprojection error of an accepted image, pixels; 0: no limit");
}

std::optional<std::vector<Eigen::Vector2d>> find_chessboard(const GrayImage& image,
                                                            const Chessboard& board) {
  if (image.empty()) return std::nullopt;
  const cv::Mat pixels = as_mat(image);
  std::vector<Eigen::Vector2d> corners;
  try {
    const Points2 found = refine_corners(pixels, board, coarse_corners(pixels, board));
    for (const cv::Point2f& corner : found) corners.emplace_back(corner.x, corner.y);
  } catch (const cv::Exception&) {
    return std::nullopt;  // the image is smaller than the filters
  }
  if (corners.empty()) return std::nullopt;
  return corners;
}

std::vector<Eigen::Vector3d> corners_on_board(const Chessboard& board) {
  std::vector<Eigen::Vector3d> corners;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      corners.emplace_back(column * board.square_mm * 1e-3, row * board.square_mm * 1e-3, 0.0);
  return corners;
}

std::optional<Pose> locate_chessboard(const std::vector<Eigen::Vector2d>& rays,
                                      const Chessboard& board) {
  if (rays.size() != corner_count(board)) return std::nullopt;
  try {
    return pose_by_rays(corners_on_board(board), rays);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
}

GrayImage stretch_contrast(const Image<std::uint16_t>& image) {
  GrayImage gray(image.width, image.height);
  if (image.empty()) return gray;
  std::vector<std::uint16_t> sorted = image.pixels;
  const auto percentile = [&](std::size_t percent) {
    const std::size_t index = (sorted.size() - 1) * percent / 100;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(index),
                     sorted.end());
    return static_cast<double>(sorted[index]);
  };
  const double low = percentile(1);
  const double high = std::max(percentile(99), low + 1);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const double fraction = std::clamp((image.pixels[n] - low) / (high - low), 0.0, 1.0);
    gray.pixels[n] = static_cast<std::uint8_t>(std::lround(255 * fraction));
  }
  return gray;
}

double CameraCalibrationResult::relative_focal_deviation() const {
  return std::max(deviations.at(0) / camera.fx, deviations.at(1) / camera.fy);
}

CameraCalibrationResult calibrate_camera(const std::vector<BoardImage>& images, int width,
                                         int height, const CameraCalibrationOptions& options) {
  std::vector<BoardImage> kept;
  std::vector<std::string> repeated;
  std::vector<std::string> rejected;
  for (const BoardImage& image : images) {
    const bool is_new = std::none_of(kept.begin(), kept.end(), [&](const BoardImage& earlier) {
      return shows_the_same(earlier, image);
    });
    if (is_new)
      kept.push_back(image);
    else
      repeated.push_back(image.name);
  }
  const auto reject = [&](std::size_t n) {
    rejected.push_back(kept[n].name);
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(n));
  };
  for (;;) {
    CameraCalibrationResult result;
    try {
      result = calibrate_once(kept, width, height, options);
    } catch (const Error&) {
      if (options.max_image_error_px == 0) throw;
      const auto odd = find_odd_image(kept, width, height, options);
      if (!odd) throw;
      reject(*odd);
      continue;
    }
    const auto worst = std::max_element(
        result.images.begin(), result.images.end(),
        [](const CalibratedImage& a, const CalibratedImage& b) { return a.rms_px < b.rms_px; });
    if (options.max_image_error_px == 0 || worst->rms_px <= options.max_image_error_px) {
      result.rejected = rejected;
      result.repeated = repeated;
      return result;
    }
    // One image at a time, because a bad image increases the errors of the others.
    reject(static_cast<std::size_t>(worst - result.images.begin()));
  }
}

}  // namespace libmap
