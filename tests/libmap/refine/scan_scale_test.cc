#include "libmap/refine/scan_scale.h"

#include <gtest/gtest.h>

#include "libmap/core/error.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace scan_scale_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::error_of;
using graspmap_test::TexturedScan;
using libmap::KnownLength;
using libmap::parse_known_length;
using libmap::Pose;

TEST(KnownLength, IsTwoPixelsAndTheirDistance) {
  const KnownLength known = parse_known_length("12:320:240-31:100:200.5=1.5");
  EXPECT_EQ(known.from.node, 12);
  EXPECT_EQ(known.from.pixel, Eigen::Vector2d(320, 240));
  EXPECT_EQ(known.to.node, 31);
  EXPECT_EQ(known.to.pixel, Eigen::Vector2d(100, 200.5));
  EXPECT_EQ(known.length_m, 1.5);
  for (const std::string text :
       {"", "12:320:240", "12:320:240-31:100:200", "12:1:2-3:4:5=0", "12:1:2-3:4:5=-1",
        "12:1:2-3:4:5=nan", "a:1:2-3:4:5=1", "12:1,2-3:4:5=1", "12:1:2-3:4=1", "1:1:1-2:2:2=1e9"})
    EXPECT_EQ(error_of([&] { parse_known_length(text); }).context().value, text);
}

struct Frames {
  std::vector<libmap::FrameFeatures> frames;
  std::map<int, Pose> poses;
};

Frames two_frames() {
  TexturedScan scan;
  Frames made;
  for (int n = 0; n < 2; ++n) {
    scan.see(boulders(), around(20.0 * n), libmap::Vector6d::Zero(), false);
    made.poses[n + 1] = around(20.0 * n);
  }
  made.frames = libmap::find_features(scan, {1, 2}).frames;
  return made;
}

// Scene point at the pixel of the node, in closed form.
Eigen::Vector3d shown(int node, const Eigen::Vector2d& pixel) {
  const libmap::Camera camera = graspmap_test::textured_camera();
  const Pose eye = around(20.0 * (node - 1)) * camera.base_from_camera;
  const Eigen::Vector3d ray =
      eye.linear() * libmap::pixel_to_ray(camera, pixel)->homogeneous().eval();
  return eye.translation() + boulders()(eye.translation(), ray) * ray;
}

std::vector<KnownLength> lengths_times(double factor) {
  std::vector<KnownLength> lengths = {{{1, {60, 100}}, {2, {190, 110}}, 0.0},
                                      {{1, {100, 150}}, {1, {180, 60}}, 0.0},
                                      {{2, {70, 140}}, {2, {200, 150}}, 0.0}};
  for (KnownLength& known : lengths)
    known.length_m =
        factor *
        (shown(known.from.node, known.from.pixel) - shown(known.to.node, known.to.pixel)).norm();
  return lengths;
}

TEST(ScanScale, KnownLengthsGiveTheFactor) {
  const Frames made = two_frames();
  for (const double factor : {1.0, 1.03}) {
    const auto scale = libmap::scale_by_lengths(made.frames, {}, made.poses, lengths_times(factor));
    EXPECT_EQ(scale.lengths, 3U);
    EXPECT_GT(scale.deviation, 1e-4);
    EXPECT_LT(scale.deviation, 0.01);
    EXPECT_NEAR(scale.factor, factor, 3.0 * scale.deviation);
    EXPECT_LT(scale.chi_square, 9.0);
  }
  // A length that contradicts the others raises chi-square.
  std::vector<KnownLength> wrong = lengths_times(1.0);
  wrong[1].length_m *= 1.2;
  EXPECT_GT(libmap::scale_by_lengths(made.frames, {}, made.poses, wrong).chi_square, 9.0);
}

TEST(ScanScale, PlacesThatShowNothingAreNamed) {
  const Frames made = two_frames();
  const auto value_of = [&](const KnownLength& known) {
    return error_of([&] { libmap::scale_by_lengths(made.frames, {}, made.poses, {known}); })
        .context()
        .value;
  };
  const auto early_value_of = [&](const KnownLength& known) {
    return error_of([&] { libmap::check_known_lengths(made.frames, {known}); }).context().value;
  };
  EXPECT_EQ(early_value_of({{1, {60, 100}}, {7, {90, 110}}, 1.0}), "7:90:110");
  EXPECT_EQ(early_value_of({{1, {60, 256}}, {2, {90, 110}}, 1.0}), "1:60:256");
  libmap::check_known_lengths(made.frames, {{{1, {60, 100}}, {2, {90, 110}}, 1.0}});
  EXPECT_EQ(value_of({{7, {60, 100}}, {2, {90, 110}}, 1.0}), "7:60:100");
  EXPECT_EQ(value_of({{1, {60, 100}}, {2, {-1, 110}}, 1.0}), "2:-1:110");
  EXPECT_EQ(value_of({{1, {60, 100}}, {2, {256, 110}}, 1.0}), "2:256:110");
  EXPECT_EQ(value_of({{1, {60, 100}}, {1, {60, 100}}, 1.0}), "1:60:100") << "no distance";
}

TEST(ScanScale, AppliedScaleMovesPosesAndDepthAlike) {
  std::map<int, Pose> poses = two_frames().poses;
  const std::map<int, Pose> before = poses;
  libmap::SensorCalibration calibration;
  calibration.depth = {{0.5, 0.25, {0.01, 0.02, 0.01, 0.0}, {}}};
  const double corrected = 1.2 + calibration.depth[0].at(1.2, 0.3);
  libmap::apply_scale(1.05, 1, 1, poses, calibration);
  EXPECT_TRUE(poses.at(1).isApprox(before.at(1), 0.0)) << "the fixed node";
  EXPECT_LT((poses.at(2).translation() - poses.at(1).translation() -
             1.05 * (before.at(2).translation() - before.at(1).translation()))
                .norm(),
            1e-12);
  EXPECT_NEAR(1.2 + calibration.depth[0].at(1.2, 0.3), 1.05 * corrected, 1e-12);
}

// Depth is too large by 0.8 %, which is known.
TEST(ScanScale, GivenFactorCorrectsPosesAndDepth) {
  TexturedScan scan;
  for (int n = 0; n < 8; ++n) {
    scan.see(boulders(), around(18.0 * n), graspmap_test::random_step(0.015, 0.012));
    for (float& depth : scan.frames.at(n + 1).depth.pixels) depth *= 1.008F;
  }
  libmap::RefinementOptions options = graspmap_test::small_options();
  const libmap::RefinementResult before = libmap::refine_poses(scan, options);
  options.scale = 1.0 / 1.008;
  const libmap::RefinementResult after = libmap::refine_poses(scan, options);
  EXPECT_GT(before.stages.back().error->absolute.rmse_m, 0.003);
  EXPECT_LT(after.stages.back().error->absolute.rmse_m, 0.002);
  EXPECT_EQ(after.stages.back().name, "scale");
  EXPECT_EQ(after.scale, "scale x " + libmap::to_text(options.scale) + " as given: corrected");
  ASSERT_EQ(after.poses.size(), 8U);
  const auto moved = [](const libmap::RefinementResult& result) -> Eigen::Vector3d {
    return result.poses.back().world_from_base.translation() -
           result.poses.front().world_from_base.translation();
  };
  EXPECT_LT((1.008 * moved(after) - moved(before)).norm(), 1e-9);
  ASSERT_EQ(after.calibration.depth.size(), 1U);
  const auto corrected = [](const libmap::RefinementResult& result) {
    const auto& depth = result.calibration.depth;
    return 1.2 + (depth.empty() ? 0.0 : depth[0].at(1.2, 0.1));
  };
  EXPECT_NEAR(1.008 * corrected(after), corrected(before), 1e-9);
}

TEST(ScanScale, GivenFactorIsTheOnlySourceOfTheScale) {
  TexturedScan scan;
  for (int n = 0; n < 2; ++n)
    scan.see(boulders(), around(20.0 * n), libmap::Vector6d::Zero(), false);
  libmap::RefinementOptions lengths = graspmap_test::small_options();
  lengths.scale = 0.99;
  libmap::RefinementOptions board = lengths;
  libmap::RefinementOptions odometry = lengths;
  lengths.known_lengths = {{{1, {60, 100}}, {2, {90, 110}}, 1.0}};
  board.board = libmap::parse_known_board("8x6:0.06");
  odometry.scale_from = libmap::ScaleSource::odometry;
  for (const libmap::RefinementOptions& options : {lengths, board, odometry}) {
    const auto error = error_of([&] { libmap::refine_poses(scan, options); });
    EXPECT_EQ(error.context().field, "scale");
    EXPECT_EQ(error.context().value, "0.99");
    EXPECT_EQ(error.context().bound, "1 with known lengths, a board or the scale from odometry");
  }
}

TEST(ScanScale, OdometryWeighsItsLinks) {
  const std::map<int, Pose> poses = {{1, Pose::Identity()},
                                     {2, Pose(Eigen::Translation3d(1, 0, 0))},
                                     {3, Pose(Eigen::Translation3d(1, 2, 0))}};
  libmap::GraphLinkResult first;
  first.link = {1, 2, libmap::LinkType::neighbor, Pose(Eigen::Translation3d(1.1, 0, 0)),
                100.0 * libmap::Matrix6d::Identity()};
  libmap::GraphLinkResult second;
  second.link = {2, 3, libmap::LinkType::neighbor, Pose(Eigen::Translation3d(0, 2.1, 0)),
                 400.0 * libmap::Matrix6d::Identity()};
  const auto scale = libmap::scale_by_odometry({first, second}, poses);
  ASSERT_TRUE(scale);
  // Weighted least squares: (100 1 1.1 + 400 2 2.1) / (100 + 400 4).
  EXPECT_NEAR(scale->factor, 1790.0 / 1700.0, 1e-12);
  EXPECT_NEAR(scale->deviation, 1.0 / std::sqrt(1700.0), 1e-12);
  second.rejected = true;
  EXPECT_NEAR(libmap::scale_by_odometry({first, second}, poses)->factor, 1.1, 1e-12);
  EXPECT_FALSE(libmap::scale_by_odometry({}, poses));
}

}  // namespace scan_scale_test
