#include "libmap/refine/board_scale.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "libmap/core/error.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/chessboard_image.h"
#include "tests/support/test_support.h"

namespace board_scale_test {

using graspmap_test::around;
using graspmap_test::ChessboardPainter;
using graspmap_test::error_of;
using graspmap_test::PaintedBoard;
using graspmap_test::random_engine;
using graspmap_test::textured_camera;
using graspmap_test::TexturedScan;
using libmap::BoardView;
using libmap::Camera;
using libmap::Chessboard;
using libmap::Matrix6d;
using libmap::moved;
using libmap::parse_known_board;
using libmap::Pose;
using libmap::ScaleEstimate;
using libmap::Vector6d;

constexpr double true_scale = 1.008;

TEST(KnownBoard, IsCornersAndASide) {
  const Chessboard board = parse_known_board("9x6:0.025");
  EXPECT_EQ(board.columns, 9);
  EXPECT_EQ(board.rows, 6);
  EXPECT_NEAR(board.square_mm, 25.0, 1e-12);
  for (const std::string text :
       {"", "8x6", "8x6:", "8x6:0", "8x6:-1", "8x6:nan", "8x6:30", "8x6:0.03m", "8x6:0.03:0.03"})
    EXPECT_EQ(error_of([&] { parse_known_board(text); }).context().value, text);
  for (const std::string text : {"8:0.03", "2x6:0.03", "8x6x4:0.03", ":0.03"})
    EXPECT_EQ(error_of([&] { parse_known_board(text); }).context().field, "board") << text;
}

// Poses in units of a depth camera with the error true_scale, and views of the board.
struct Scene {
  PaintedBoard painted{};
  Chessboard board{};
  std::vector<libmap::FrameFeatures> frames{};
  std::map<int, Pose> poses{};
  std::map<int, Matrix6d> covariance{};
  std::vector<BoardView> views{};

  ScaleEstimate scale(const libmap::SensorCalibration& calibration = {}) const {
    return libmap::scale_by_board(frames, calibration, poses, covariance, views, board);
  }
};

// On the ground before the cameras, x to the right of the first one.
Pose board_at(double x) {
  Pose pose(Eigen::Translation3d(x, 0.1, 0.02));
  pose.rotate(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()));
  return pose;
}

// With `stored` as the camera of the frames while images are those of textured_camera().
Scene scene_of(std::size_t count, double step_deg, const Camera& stored = textured_camera()) {
  Scene scene;
  Camera camera = textured_camera();
  Camera one_pixel = camera;  // the painter's rays are not wanted
  one_pixel.width = one_pixel.height = 1;
  const ChessboardPainter painter(one_pixel, 1);
  for (std::size_t n = 0; n < count; ++n) {
    const int node = static_cast<int>(n) + 1;
    Pose pose = around(step_deg * static_cast<double>(n), 0.6 + 0.02 * static_cast<double>(n % 5));
    scene.views.push_back(
        {node, 0,
         painter.corners(scene.painted,
                         (pose * camera.base_from_camera).inverse() * board_at(0.0))});
    pose.translation() /= true_scale;
    scene.poses[node] = pose;
    libmap::FrameFeatures frame;
    frame.node = node;
    frame.cameras = {stored};
    scene.frames.push_back(frame);
  }
  return scene;
}

TEST(BoardScale, ExactCornersGiveTheFactor) {
  for (const std::size_t count : {2U, 3U, 12U}) {
    const Scene scene = scene_of(count, 17.0);
    const ScaleEstimate scale = scene.scale();
    EXPECT_NEAR(scale.factor, true_scale, 1e-6) << count;
    EXPECT_EQ(scale.lengths, count);
    EXPECT_LT(scale.deviation, 1e-3);
    EXPECT_LT(scale.chi_square, 1e-3);
  }
}

// OpenCV may begin at either end of the board, or of its rows.
TEST(BoardScale, AnyOrderOfTheCornersIsTheSameBoard) {
  Scene scene = scene_of(6, 17.0);
  std::reverse(scene.views[1].corners.begin(), scene.views[1].corners.end());
  for (int row = 0; row < 6; ++row)
    std::reverse(scene.views[4].corners.begin() + 8 * row,
                 scene.views[4].corners.begin() + 8 * (row + 1));
  EXPECT_NEAR(scene.scale().factor, true_scale, 1e-6);
  EXPECT_EQ(scene.scale().lengths, 6U);
}

TEST(BoardScale, OtherAndMovedBoardsAreLeftOut) {
  for (const double shift_m : {0.02, 0.6}) {
    Scene scene = scene_of(10, 11.0);
    const ChessboardPainter painter(textured_camera(), 1);
    for (const std::size_t n : {0U, 6U, 7U}) {
      Pose pose = scene.poses.at(static_cast<int>(n) + 1);
      pose.translation() *= true_scale;
      scene.views[n].corners =
          painter.corners(scene.painted, (pose * textured_camera().base_from_camera).inverse() *
                                             board_at(n == 0 ? -shift_m : shift_m));
    }
    for (auto& [node, pose] : scene.poses) scene.covariance[node] = 1e-8 * Matrix6d::Identity();
    const ScaleEstimate scale = scene.scale();
    EXPECT_NEAR(scale.factor, true_scale, 1e-6) << shift_m;
    EXPECT_EQ(scale.lengths, 7U) << shift_m;
  }
}

TEST(BoardScale, CalibrationIsApplied) {
  libmap::SensorCalibration calibration;
  calibration.intrinsics = {{0.01, 0.01, 4.0, -2.0}};
  Camera stored = textured_camera();
  stored.fx /= 1.01;
  stored.fy /= 1.01;
  stored.cx -= 4.0;
  stored.cy += 2.0;
  const Scene scene = scene_of(6, 17.0, stored);
  EXPECT_NEAR(scene.scale(calibration).factor, true_scale, 1e-6);
  EXPECT_GT(std::abs(scene.scale().factor - true_scale), 1e-4);
}

// Errors of poses and corners as large as stated: the factor's errors are as large as stated.
TEST(BoardScale, DeviationsAreThoseOfRepeatedScans) {
  constexpr int rounds = 200;
  std::normal_distribution<double> error(0.0, 1.0);
  const Scene exact = scene_of(5, 13.0);
  double squares = 0.0;
  double chi_squares = 0.0;
  for (int round = 0; round < rounds; ++round) {
    Scene scene = exact;
    for (auto& [node, pose] : scene.poses) {
      Vector6d deviations;
      deviations << Eigen::Vector3d::Constant(5e-4), Eigen::Vector3d::Constant(3e-4);
      scene.covariance[node] = deviations.cwiseAbs2().asDiagonal();
      Vector6d step;
      for (double& value : step) value = error(random_engine());
      pose = moved(pose, step.cwiseProduct(deviations));
    }
    for (BoardView& view : scene.views)
      for (Eigen::Vector2d& corner : view.corners)
        for (double& value : corner) value += 0.1 * error(random_engine());
    const ScaleEstimate scale = scene.scale();
    squares += std::pow((scale.factor - true_scale) / scale.deviation, 2) / rounds;
    chi_squares += scale.chi_square / rounds;
  }
  EXPECT_NEAR(chi_squares, 1.0, 0.15);
  // The deviation grows with chi-square and does not shrink.
  EXPECT_GT(std::sqrt(squares), 0.75);
  EXPECT_LT(std::sqrt(squares), 1.1);
}

TEST(BoardScale, ViewsThatDoNotDetermineItAreAnError) {
  const auto fails = [](const Scene& scene) {
    return error_of([&] { scene.scale(); }).context().value == "8x6:0.03";
  };
  EXPECT_TRUE(fails(scene_of(0, 0.0)));
  EXPECT_TRUE(fails(scene_of(1, 0.0)));
  Scene scene = scene_of(2, 40.0);
  scene.views[1].node = 9;  // without a pose
  EXPECT_TRUE(fails(scene));
  // All from one place.
  scene = scene_of(6, 0.0);
  for (std::size_t n = 0; n < 6; ++n) {
    scene.views[n].corners = scene.views[0].corners;
    scene.poses.at(static_cast<int>(n) + 1) = scene.poses.at(1);
    scene.covariance[static_cast<int>(n) + 1] = 1e-8 * Matrix6d::Identity();
  }
  EXPECT_TRUE(fails(scene));
}

// Ground with boulders and a board between them, by a camera whose depth is too large.
TEST(BoardScale, RefinedPosesHaveTheScaleOfTheBoard) {
  const PaintedBoard painted{.square_m = 0.06};
  const ChessboardPainter painter(textured_camera(), 3);
  const auto ground = graspmap_test::nearest_of({graspmap_test::plane_z(0.0),
                                                 graspmap_test::sphere({0.1, 0.85, -0.05}, 0.3),
                                                 graspmap_test::sphere({-0.7, -0.2, 0.0}, 0.25),
                                                 graspmap_test::sphere({0.5, -0.6, -0.05}, 0.3)});
  TexturedScan scan;
  for (int n = 0; n < 12; ++n) {
    const Pose pose = around(18.0 * n, 1.1 + 0.1 * std::sin(0.8 * n));
    scan.see(ground, pose, graspmap_test::random_step(0.015, 0.012));
    const auto image = painter.paint(
        painted, (pose * textured_camera().base_from_camera).inverse() * board_at(-0.2));
    libmap::RgbdFrame& frame = scan.frames.at(n + 1);
    for (std::size_t pixel = 0; pixel < image.pixels.size(); ++pixel)
      if (image.pixels[pixel] != 120.0F)  // the background
        frame.color.pixels[pixel].fill(static_cast<std::uint8_t>(image.pixels[pixel]));
    for (float& depth : frame.depth.pixels) depth *= 1.008F;
  }
  libmap::RefinementOptions options = graspmap_test::small_options();
  const auto rmse_m = [](const libmap::RefinementResult& result) {
    return result.stages.back().error->absolute.rmse_m;
  };
  EXPECT_GT(rmse_m(libmap::refine_poses(scan, options)), 0.006);
  options.board = parse_known_board("8x6:0.06");
  const libmap::RefinementResult result = libmap::refine_poses(scan, options);
  EXPECT_LT(rmse_m(result), 0.002);
  ASSERT_EQ(result.stages.back().name, "scale");
  std::map<std::string, double> metrics(result.stages.back().metrics.begin(),
                                        result.stages.back().metrics.end());
  EXPECT_GE(metrics.at("lengths"), 8.0);
  EXPECT_LT(metrics.at("deviation"), 0.001);
  EXPECT_NEAR(metrics.at("factor"), 1.0 / 1.008, 3.0 * metrics.at("deviation"));
  EXPECT_TRUE(result.scale.ends_with("images: corrected")) << result.scale;
  options.known_lengths = {{{1, {60, 100}}, {2, {90, 110}}, 1.0}};
  EXPECT_EQ(error_of([&] { libmap::refine_poses(scan, options); }).context().field, "board");
}

}  // namespace board_scale_test
