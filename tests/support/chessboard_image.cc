#include "tests/support/chessboard_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/support/test_support.h"

namespace graspmap_test {

namespace {

using libmap::Camera;
using libmap::Pose;

constexpr float gray = 120;
constexpr float black = 25;
constexpr float white = 225;

float intensity(const PaintedBoard& board, double x, double y) {
  // Position in squares from the outer corner of the first square.
  const double column = x / board.square_m + 1;
  const double row = y / board.square_m + 1;
  const double columns = board.columns + 1;
  const double rows = board.rows + 1;
  if (column < -1 || row < -1 || column > columns + 1 || row > rows + 1) return gray;
  if (column < 0 || row < 0 || column > columns || row > rows) return white;
  const int parity = static_cast<int>(std::floor(column)) + static_cast<int>(std::floor(row));
  return parity % 2 == 0 ? black : white;
}

std::vector<Eigen::Vector3d> corner_points(const PaintedBoard& board) {
  std::vector<Eigen::Vector3d> points;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      points.emplace_back(column * board.square_m, row * board.square_m, 0.0);
  return points;
}

bool is_inside(const Camera& camera, const PaintedBoard& board, const Pose& pose, double margin) {
  for (const Eigen::Vector3d& corner : corner_points(board)) {
    const auto pixel = libmap::project_point(camera, pose * corner);
    if (!pixel || pixel->x() < margin || pixel->y() < margin ||
        pixel->x() > camera.width - 1 - margin || pixel->y() > camera.height - 1 - margin)
      return false;
  }
  return true;
}

// Filters one row or column; its ends are repeated.
void blur_line(libmap::Image<float>& image, const std::vector<float>& weights, bool along_rows) {
  const libmap::Image<float> before = image;
  const int reach = static_cast<int>(weights.size() / 2);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      float sum = 0;
      for (int k = -reach; k <= reach; ++k)
        sum += weights[static_cast<std::size_t>(k + reach)] *
               (along_rows ? before.at(std::clamp(x + k, 0, image.width - 1), y)
                           : before.at(x, std::clamp(y + k, 0, image.height - 1)));
      image.at(x, y) = sum;
    }
}

}  // namespace

ChessboardPainter::ChessboardPainter(const Camera& camera, int samples)
    : camera_(camera), samples_(samples) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      for (int n = 0; n < samples * samples; ++n) {
        const double dx = (n % samples + 0.5) / samples - 0.5;
        const double dy = (n / samples + 0.5) / samples - 0.5;
        rays_.push_back(
            libmap::pixel_to_ray(camera, {x + dx, y + dy}).value_or(Eigen::Vector2d(nan, nan)));
      }
}

libmap::Image<float> ChessboardPainter::paint(const PaintedBoard& board,
                                              const Pose& camera_from_board) const {
  const Pose board_from_camera = camera_from_board.inverse();
  const Eigen::Vector3d eye = board_from_camera.translation();
  libmap::Image<float> photo(camera_.width, camera_.height);
  const auto per_pixel = static_cast<std::size_t>(samples_ * samples_);
  for (std::size_t pixel = 0; pixel < photo.pixels.size(); ++pixel) {
    float sum = 0;
    for (std::size_t n = 0; n < per_pixel; ++n) {
      const Eigen::Vector2d& ray = rays_[pixel * per_pixel + n];
      const Eigen::Vector3d direction =
          board_from_camera.linear() * Eigen::Vector3d(ray.x(), ray.y(), 1);
      const double reach = -eye.z() / direction.z();
      const bool hits = reach > 0 && std::isfinite(reach);
      sum +=
          hits ? intensity(board, eye.x() + reach * direction.x(), eye.y() + reach * direction.y())
               : gray;
    }
    photo.pixels[pixel] = sum / static_cast<float>(per_pixel);
  }
  return photo;
}

std::vector<Eigen::Vector2d> ChessboardPainter::corners(const PaintedBoard& board,
                                                        const Pose& camera_from_board) const {
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& corner : corner_points(board))
    pixels.push_back(libmap::project_point(camera_, camera_from_board * corner).value());
  return pixels;
}

std::vector<Pose> board_poses(const Camera& camera, const PaintedBoard& board, int count,
                              double max_tilt_deg, double margin_px) {
  const Eigen::Vector3d middle((board.columns - 1) * board.square_m / 2,
                               (board.rows - 1) * board.square_m / 2, 0.0);
  const double width = (board.columns + 1) * board.square_m;
  std::vector<Pose> poses;
  for (int attempt = 0; attempt < 100000 && static_cast<int>(poses.size()) < count; ++attempt) {
    const double distance = width * camera.fx / camera.width * uniform(1.1, 2.2);
    const double azimuth = uniform(0, 2 * M_PI);
    const double tilt = uniform(0, max_tilt_deg) * M_PI / 180;
    const Eigen::Vector2d pixel(uniform(0.1, 0.9) * camera.width,
                                uniform(0.1, 0.9) * camera.height);
    const auto ray = libmap::pixel_to_ray(camera, pixel);
    if (!ray) continue;
    Pose pose = Pose::Identity();
    pose.linear() =
        (Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0)) *
         Eigen::AngleAxisd(uniform(-0.3, 0.3), Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    pose.translation() = Eigen::Vector3d(ray->x(), ray->y(), 1) * distance - pose.linear() * middle;
    if (is_inside(camera, board, pose, margin_px)) poses.push_back(pose);
  }
  return poses;
}

libmap::GrayImage photographed(const libmap::Image<float>& photo, double blur_px, double noise) {
  libmap::Image<float> image = photo;
  if (blur_px > 0) {
    const int reach = static_cast<int>(std::ceil(3 * blur_px));
    std::vector<float> weights;
    float sum = 0;
    for (int k = -reach; k <= reach; ++k) {
      weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (blur_px * blur_px))));
      sum += weights.back();
    }
    for (float& weight : weights) weight /= sum;
    blur_line(image, weights, true);
    blur_line(image, weights, false);
  }
  std::normal_distribution<double> error(0.0, 1.0);
  libmap::GrayImage gray(image.width, image.height);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const double value = image.pixels[n] + noise * error(random_engine());
    gray.pixels[n] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  }
  return gray;
}

}  // namespace graspmap_test
