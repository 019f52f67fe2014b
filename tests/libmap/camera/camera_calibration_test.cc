#include "libmap/camera/camera_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "tests/support/chessboard_image.h"
#include "tests/support/test_support.h"

namespace camera_calibration_test {

using graspmap_test::board_poses;
using graspmap_test::ChessboardPainter;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::PaintedBoard;
using graspmap_test::photographed;
using graspmap_test::random_engine;
using libmap::BoardImage;
using libmap::Camera;
using libmap::CameraCalibrationOptions;
using libmap::CameraCalibrationResult;
using libmap::DistortionModel;
using libmap::find_chessboard;
using libmap::LensModel;
using libmap::Pose;
using libmap::stretch_contrast;

Camera kinect(DistortionModel model, std::vector<double> terms) {
  Camera camera;
  camera.width = 512;
  camera.height = 424;
  camera.fx = 365.2;
  camera.fy = 366.1;
  camera.cx = 257.3;
  camera.cy = 206.1;
  camera.distortion_model = model;
  camera.distortion = std::move(terms);
  return camera;
}

struct Lens {
  const char* name;
  LensModel lens;
  Camera camera;
};

std::vector<Lens> lenses() {
  return {{"none", LensModel::none, kinect(DistortionModel::none, {})},
          {"plumb_bob", LensModel::plumb_bob,
           kinect(DistortionModel::radial_tangential, {0.09, -0.27, 0.001, -0.0007, 0.09})},
          {"rational", LensModel::rational,
           kinect(DistortionModel::radial_tangential,
                  {0.4, -0.2, 0.001, -0.0007, 0.05, 0.3, -0.1, 0.02})},
          {"equidistant", LensModel::equidistant,
           kinect(DistortionModel::equidistant, {0.05, -0.02, 0.01, -0.003})}};
}

// Corners where they are, with Gaussian noise: no image is painted.
std::vector<BoardImage> noisy_corners(const Camera& camera, const std::vector<Pose>& poses,
                                      double sigma_px) {
  Camera one_pixel = camera;  // the painter's rays are not wanted
  one_pixel.width = one_pixel.height = 1;
  const ChessboardPainter painter(one_pixel, 1);
  std::normal_distribution<double> error(0.0, 1.0);
  std::vector<BoardImage> images;
  for (const Pose& pose : poses) {
    BoardImage image;
    image.name = "picture " + std::to_string(images.size());
    for (const Eigen::Vector2d& corner : painter.corners({}, pose)) {
      const double dx = sigma_px * error(random_engine());
      const double dy = sigma_px * error(random_engine());
      image.corners.emplace_back(corner.x() + dx, corner.y() + dy);
    }
    images.push_back(image);
  }
  return images;
}

std::vector<double> values_of(const Camera& camera) {
  std::vector<double> values = {camera.fx, camera.fy, camera.cx, camera.cy};
  values.insert(values.end(), camera.distortion.begin(), camera.distortion.end());
  return values;
}

TEST(CameraCalibration, ExactCornersGiveTheCamera) {
  for (const Lens& lens : lenses()) {
    const auto poses = board_poses(lens.camera, {}, 15, 45);
    ASSERT_EQ(poses.size(), 15U);
    CameraCalibrationOptions options;
    options.lens = lens.lens;
    const CameraCalibrationResult result =
        calibrate_camera(noisy_corners(lens.camera, poses, 0), 512, 424, options);
    // OpenCV takes corners as float32.
    EXPECT_LT(result.rms_px, 1e-4) << lens.name;
    EXPECT_NEAR(result.camera.fx, lens.camera.fx, 0.01) << lens.name;
    EXPECT_NEAR(result.camera.cy, lens.camera.cy, 0.01) << lens.name;
    EXPECT_EQ(result.camera.distortion.size(), lens.camera.distortion.size());
    for (std::size_t n = 0; n < poses.size(); ++n)
      EXPECT_LT((result.images[n].camera_from_board.matrix() - poses[n].matrix()).norm(), 1e-4)
          << lens.name;
  }
}

TEST(CameraCalibration, DeviationsAreThoseOfRepeatedCalibrations) {
  constexpr int rounds = 40;
  for (const Lens& lens : {lenses()[1], lenses()[3]}) {
    const auto poses = board_poses(lens.camera, {}, 10, 45);
    CameraCalibrationOptions options;
    options.lens = lens.lens;
    const std::vector<double> truth = values_of(lens.camera);
    std::vector<double> squares(truth.size(), 0.0);
    std::vector<double> claimed(truth.size(), 0.0);
    for (int round = 0; round < rounds; ++round) {
      const CameraCalibrationResult result =
          calibrate_camera(noisy_corners(lens.camera, poses, 0.1), 512, 424, options);
      EXPECT_NEAR(result.sigma_px, 0.1, 0.01);
      const std::vector<double> values = values_of(result.camera);
      for (std::size_t n = 0; n < values.size(); ++n) {
        squares[n] += std::pow(values[n] - truth[n], 2) / rounds;
        claimed[n] += result.deviations[n] / rounds;
      }
    }
    // A deviation estimated from 40 rounds is itself known to 11 %.
    for (std::size_t n = 0; n < truth.size(); ++n)
      EXPECT_NEAR(std::sqrt(squares[n]) / claimed[n], 1.0, 0.35) << lens.name << " " << n;
  }
}

TEST(CameraCalibration, DeviationsAreOpenCvsButForTheNumberOfMeasurements) {
  const Lens lens = lenses()[1];
  const auto images = noisy_corners(lens.camera, board_poses(lens.camera, {}, 12, 45), 0.2);
  const CameraCalibrationResult result = calibrate_camera(images, 512, 424);
  std::vector<std::vector<cv::Point3f>> boards(images.size());
  std::vector<std::vector<cv::Point2f>> corners(images.size());
  for (std::size_t n = 0; n < images.size(); ++n)
    for (int k = 0; k < 48; ++k) {
      const int row = k / 8;
      boards[n].emplace_back(static_cast<float>(k % 8) * 0.03F, static_cast<float>(row) * 0.03F,
                             0.0F);
      const Eigen::Vector2f corner = images[n].corners[static_cast<std::size_t>(k)].cast<float>();
      corners[n].emplace_back(corner.x(), corner.y());
    }
  cv::Mat matrix, terms, deviations, of_poses, errors;
  std::vector<cv::Mat> rotations, translations;
  cv::calibrateCamera(boards, corners, cv::Size(512, 424), matrix, terms, rotations, translations,
                      deviations, of_poses, errors);
  EXPECT_NEAR(result.camera.fx, matrix.at<double>(0, 0), 1e-3);
  // OpenCV 4.6 divides by the number of points, not of coordinates.
  const double points = 12 * 48;
  const double unknowns = 9 + 6 * 12;
  const double ratio = std::sqrt((points - unknowns) / (2 * points - unknowns));
  for (int n = 0; n < 9; ++n)
    EXPECT_NEAR(result.deviations[static_cast<std::size_t>(n)] / deviations.at<double>(n), ratio,
                0.01 * ratio)
        << n;
  for (int n = 0; n < 12; ++n)
    EXPECT_NEAR(result.images[static_cast<std::size_t>(n)].rms_px, errors.at<double>(n), 1e-3);
}

TEST(CameraCalibration, PaintedBoardsGiveTheCamera) {
  for (const Lens& lens : {lenses()[1], lenses()[3]}) {
    const ChessboardPainter painter(lens.camera, 3);
    std::vector<BoardImage> images;
    for (const Pose& pose : board_poses(lens.camera, {}, 15, 45)) {
      const auto found =
          find_chessboard(photographed(painter.paint({}, pose), 0.7, 3.0), {8, 6, 30.0});
      if (found) images.push_back({"painted", *found});
    }
    EXPECT_GE(images.size(), 14U) << lens.name;
    CameraCalibrationOptions options;
    options.lens = lens.lens;
    const CameraCalibrationResult result = calibrate_camera(images, 512, 424, options);
    EXPECT_LT(result.rms_px, 0.1) << lens.name;
    const std::vector<double> truth = values_of(lens.camera);
    const std::vector<double> values = values_of(result.camera);
    for (std::size_t n = 0; n < truth.size(); ++n)
      EXPECT_LT(std::abs(values[n] - truth[n]), 3 * result.deviations[n]) << lens.name << " " << n;
    EXPECT_LT(result.relative_focal_deviation(), 0.002);
  }
}

TEST(FindChessboard, CornersLieWhereTheyArePainted) {
  const Camera camera = kinect(DistortionModel::none, {});
  const ChessboardPainter painter(camera, 3);
  double squares = 0;
  double count = 0;
  for (const PaintedBoard& board :
       {PaintedBoard{8, 6, 0.03}, PaintedBoard{5, 7, 0.03}, PaintedBoard{4, 3, 0.05}}) {
    for (const Pose& pose : board_poses(camera, board, 3, 40)) {
      const auto found = find_chessboard(photographed(painter.paint(board, pose), 0.7, 2.0),
                                         {board.columns, board.rows, 30.0});
      ASSERT_TRUE(found);
      std::vector<Eigen::Vector2d> truth = painter.corners(board, pose);
      ASSERT_EQ(found->size(), truth.size());
      // The first corner may be at either end.
      if ((found->front() - truth.front()).norm() > (found->front() - truth.back()).norm())
        std::reverse(truth.begin(), truth.end());
      for (std::size_t n = 0; n < truth.size(); ++n) {
        const double error = ((*found)[n] - truth[n]).norm();
        EXPECT_LT(error, 0.5);
        squares += error * error;
        count += 1;
      }
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 0.08);
}

TEST(FindChessboard, NothingWhereNoneIs) {
  const Camera camera = kinect(DistortionModel::none, {});
  EXPECT_FALSE(find_chessboard({}, {}));
  EXPECT_FALSE(find_chessboard(libmap::GrayImage(1, 1), {}));
  EXPECT_FALSE(find_chessboard(libmap::GrayImage(10, 3), {}));
  EXPECT_FALSE(find_chessboard(libmap::GrayImage(512, 424, 128), {}));
  libmap::GrayImage noise(120, 90);
  for (std::uint8_t& pixel : noise.pixels)
    pixel = static_cast<std::uint8_t>(graspmap_test::uniform(0, 256));
  EXPECT_FALSE(find_chessboard(noise, {}));
  // Half a board, or a board of another size, is not detected.
  const ChessboardPainter painter(camera, 2);
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(0.12, -0.075, 0.4);
  EXPECT_FALSE(find_chessboard(photographed(painter.paint({}, pose), 0.7, 2.0), {8, 6, 30.0}));
  pose.translation() = Eigen::Vector3d(-0.105, -0.075, 0.4);
  const auto whole = photographed(painter.paint({}, pose), 0.7, 2.0);
  EXPECT_TRUE(find_chessboard(whole, {8, 6, 30.0}));
  EXPECT_FALSE(find_chessboard(whole, {9, 7, 30.0}));
}

TEST(StretchContrast, UsesTheBulkOfTheRange) {
  libmap::Image<std::uint16_t> deep(100, 10, 700);
  for (int x = 50; x < 100; ++x)
    for (int y = 0; y < 10; ++y) deep.at(x, y) = 2700;
  for (int y = 0; y < 5; ++y) deep.at(75, y) = 65535;  // a lamp
  const libmap::GrayImage gray = stretch_contrast(deep);
  EXPECT_EQ(gray.at(10, 3), 0);
  EXPECT_EQ(gray.at(60, 3), 255);
  EXPECT_EQ(gray.at(75, 0), 255);
  EXPECT_EQ(stretch_contrast(libmap::Image<std::uint16_t>(4, 4, 9)), libmap::GrayImage(4, 4, 0));
  EXPECT_TRUE(stretch_contrast({}).empty());
}

TEST(CameraCalibration, ImagesThatTellNothingAreRefused) {
  const Camera camera = kinect(DistortionModel::none, {});
  const auto poses = board_poses(camera, {}, 8, 45);
  CameraCalibrationOptions options;
  options.lens = LensModel::none;
  const auto refused = [&](const std::vector<Pose>& chosen, double noise, LensModel lens) {
    options.lens = lens;
    return error_of(
        [&] { calibrate_camera(noisy_corners(camera, chosen, noise), 512, 424, options); });
  };
  EXPECT_TRUE(is_error(refused({poses[0], poses[1]}, 0.1, LensModel::none),
                       {.field = "number of images", .value = "2"}));
  EXPECT_TRUE(
      is_error(refused({}, 0.1, LensModel::none), {.field = "number of images", .value = "0"}));
  // Seen straight on, near and far look alike: a longer focal length is a longer distance.
  std::vector<Pose> straight;
  for (int n = 0; n < 8; ++n) {
    Pose pose = Pose::Identity();
    pose.translation() = Eigen::Vector3d(-0.13 + 0.01 * n, -0.075, 0.4 + 0.02 * n);
    straight.push_back(pose);
  }
  for (const LensModel lens : {LensModel::none, LensModel::equidistant})
    for (const double noise : {0.0, 0.1})
      EXPECT_TRUE(is_error(refused(straight, noise, lens), {.field = "images"}));
  // One image several times; one pose with noise.
  EXPECT_TRUE(is_error(refused(std::vector<Pose>(8, poses[0]), 0.0, LensModel::plumb_bob),
                       {.field = "number of images", .value = "1"}));
  EXPECT_TRUE(is_error(refused(std::vector<Pose>(8, straight[0]), 2.0, LensModel::none),
                       {.field = "images"}));
}

TEST(CameraCalibration, RepeatedImagesCountOnce) {
  const Camera camera = kinect(DistortionModel::none, {});
  auto images = noisy_corners(camera, board_poses(camera, {}, 8, 45), 0.1);
  CameraCalibrationOptions options;
  options.lens = LensModel::none;
  const auto once = calibrate_camera(images, 512, 424, options);
  for (std::size_t n = 0; n < 8; ++n) {
    images.push_back(images[n]);
    images.back().name = "again";
    std::reverse(images.back().corners.begin(), images.back().corners.end());
  }
  const auto twice = calibrate_camera(images, 512, 424, options);
  EXPECT_EQ(twice.repeated, std::vector<std::string>(8, "again"));
  EXPECT_EQ(twice.camera.fx, once.camera.fx);
  EXPECT_EQ(twice.deviations, once.deviations);
}

TEST(CameraCalibration, BadImagesAreLeftOut) {
  const Camera camera = kinect(DistortionModel::none, {});
  CameraCalibrationOptions options;
  options.lens = LensModel::none;
  options.max_image_error_px = 0.5;
  // In one of four random sets of board poses, all images together determine no camera.
  for (int round = 0; round < 12; ++round) {
    auto images = noisy_corners(camera, board_poses(camera, {}, 12, 45), 0.05);
    std::reverse(images[4].corners.begin(), images[4].corners.begin() + 8);
    const auto result = calibrate_camera(images, 512, 424, options);
    EXPECT_THAT(result.rejected, testing::ElementsAre(images[4].name));
    EXPECT_LT(result.rms_px, 0.1);
    EXPECT_EQ(result.images.size(), 11U);
    EXPECT_NEAR(result.camera.fx, camera.fx, 4 * result.deviations[0]);
  }
}

TEST(CameraCalibration, WrongArgumentsAreNamed) {
  for (const char* text : {"", "8", "8x", "x6", "8x6x3", "2x6", "8x-6", "8x1000", "8 by 6"})
    EXPECT_TRUE(is_error(error_of([&] { libmap::parse_chessboard(text, "--board"); }),
                         {.field = "--board"}))
        << text;
  EXPECT_EQ(libmap::parse_chessboard("5x7", "--board").rows, 7);
}

}  // namespace camera_calibration_test
