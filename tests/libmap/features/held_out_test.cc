#include "libmap/features/held_out.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "libmap/features/frame_calibration.h"
#include "libmap/features/surface_samples.h"
#include "libmap/optimize/icp_refinement.h"
#include "libmap/refine/sensor_calibration.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/libmap/refine/textured_scan.h"

namespace held_out_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::TexturedScan;
using libmap::HeldOutChange;
using libmap::HeldOutEvaluation;
using libmap::Pose;
using libmap::SampleUse;

TexturedScan bare_ground(int frames) {
  TexturedScan scan;
  for (int n = 0; n < frames; ++n)
    scan.see(boulders(), around(10.0 * n), libmap::Vector6d::Zero(), false);
  return scan;
}

TEST(HeldOut, MeansAreOfWhatBothSetsOfPosesSay) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const HeldOutChange change =
      libmap::compare_held_out({1.0, none, 2.0, 5.0, 3.0}, {1.5, 2.0, none, 6.0, 3.0});
  EXPECT_EQ(change.count, 3U);
  EXPECT_NEAR(change.before, 3.0, 1e-12);
  EXPECT_NEAR(change.after, 3.5, 1e-12);
  // Differences 0.5, 1, 0: a standard deviation of sqrt(1/6) of three values.
  EXPECT_NEAR(change.deviation, std::sqrt(1.0 / 18.0), 1e-12);
  EXPECT_EQ(libmap::compare_held_out({none}, {1.0}).count, 0U);
}

TEST(HeldOut, AFeatureOfUnknownDepthSaysNothing) {
  std::vector<libmap::FrameFeatures> frames = {
      graspmap_test::see_points(1, Pose::Identity(), {{1.5, 0.1, 0.1}, {1.4, -0.2, 0.1}}),
      graspmap_test::see_points(2, Pose::Identity(), {{1.5, 0.1, 0.1}, {1.4, -0.2, 0.1}})};
  libmap::FeatureLink link;
  link.frames = {0, 1};
  link.held_out = {{0, 0}, {1, 1}};
  const std::map<int, Pose> poses = {{1, Pose::Identity()}, {2, Pose::Identity()}};
  frames[1].features[0].depth_noise_m = libmap::unknown_depth_m;
  const std::vector<double> costs = libmap::match_costs(frames, {link}, poses);
  ASSERT_EQ(costs.size(), 2U);
  EXPECT_TRUE(std::isnan(costs[0]));
  EXPECT_TRUE(std::isfinite(costs[1]));
}

HeldOutEvaluation evaluation(double matches, double surfaces) {
  HeldOutEvaluation made;
  made.matches = {12000, 1.0, 1.0 + matches, 1e-4};
  made.surfaces = {36000, 1.0, 1.0 + surfaces, 1e-4};
  return made;
}

TEST(HeldOut, AnyRiseOfTheWholeIsWorse) {
  // Three surface samples have the weight of one match.
  EXPECT_NEAR(evaluation(0.002, -0.001).change(), 0.0005, 1e-12);
  EXPECT_TRUE(evaluation(1e-5, 0.0).is_worse()) << "however little";
  EXPECT_TRUE(evaluation(0.002, -0.001).is_worse());
  EXPECT_FALSE(evaluation(0.001, -0.002).is_worse());
  EXPECT_FALSE(evaluation(0.0, 0.0).is_worse());
  EXPECT_TRUE(evaluation(0.01, -0.05).is_worse()) << "a gain that the matches pay";
  EXPECT_TRUE(evaluation(-0.05, 0.01).is_worse()) << "a gain that the surfaces pay";
  EXPECT_FALSE(evaluation(0.0, -0.1).is_clearly_better()) << "only the matches tell the lens";
  EXPECT_FALSE(evaluation(-1e-4, 0.0).is_clearly_better());
  EXPECT_TRUE(evaluation(-3e-4, 0.0).is_clearly_better());
}

TEST(HeldOut, SamplesForChecksAreNoOthers) {
  const TexturedScan scan = bare_ground(2);
  const auto found = libmap::find_features(scan, {1, 2});
  std::size_t checks = 0;
  std::size_t estimation = 0;
  for (const libmap::FrameFeatures& frame : found.frames) {
    // More than available: each is used once.
    const auto of_checks = libmap::surface_samples(frame, 1000000, SampleUse::checks);
    const auto of_estimation = libmap::surface_samples(frame, 1000000, SampleUse::estimation);
    for (const auto& one : of_checks)
      for (const auto& other : of_estimation) ASSERT_NE(one.point, other.point);
    checks += of_checks.size();
    estimation += of_estimation.size();
  }
  EXPECT_NEAR(static_cast<double>(checks) / static_cast<double>(checks + estimation), 0.1, 0.05);
}

// Surface costs detect a shift normal to the ground without any matches.
TEST(HeldOut, SurfacesTellWrongPosesFromTrueOnes) {
  const TexturedScan scan = bare_ground(3);
  const auto found = libmap::find_features(scan, {1, 2, 3});
  std::vector<libmap::FeatureLink> links(2);
  links[0].frames = {0, 1};
  links[1].frames = {1, 2};
  std::map<int, Pose> truth;
  std::map<int, Pose> wrong;
  for (int n = 0; n < 3; ++n) {
    truth[n + 1] = around(10.0 * n);
    libmap::Vector6d away = libmap::Vector6d::Zero();
    away.head<3>() = truth[n + 1].linear().transpose() * Eigen::Vector3d(0, 0, 0.004 * n);
    wrong[n + 1] = libmap::moved(truth[n + 1], away);
  }
  const auto evaluated =
      libmap::evaluate_held_out(libmap::held_out_costs(found.frames, links, truth),
                                libmap::held_out_costs(found.frames, links, wrong));
  EXPECT_GT(evaluated.surfaces.count, 50U);
  EXPECT_EQ(evaluated.matches.count, 0U);
  EXPECT_GT(evaluated.change(), 3.0 * evaluated.deviation());
  EXPECT_TRUE(evaluated.is_worse());
  // A frame without a pose has no costs.
  wrong.erase(3);
  const auto fewer = libmap::evaluate_held_out(libmap::held_out_costs(found.frames, links, truth),
                                               libmap::held_out_costs(found.frames, links, wrong));
  EXPECT_LT(fewer.surfaces.count, evaluated.surfaces.count);
  EXPECT_GT(fewer.surfaces.count, 0U);
}

// Share of the common elements that differ by more than 1 mm or 0.1 degrees. At edges, planes are
// fitted to different pixels.
double fraction_of_other_elements(const std::vector<libmap::FrameFeatures>& one,
                                  const std::vector<libmap::FrameFeatures>& other) {
  double elements = 0.0;
  double others = 0.0;
  for (std::size_t n = 0; n < one.size(); ++n)
    for (int row = 0; row < one[n].surfaces[0].rows(); ++row)
      for (int column = 0; column < one[n].surfaces[0].columns(); ++column) {
        libmap::SurfacePatch a;
        libmap::SurfacePatch b;
        if (!one[n].surfaces[0].at(column, row, a) || !other[n].surfaces[0].at(column, row, b))
          continue;
        elements += 1.0;
        const bool same = (a.normal - b.normal).norm() < 2e-3 && (a.point - b.point).norm() < 1e-3;
        others += same ? 0.0 : 1.0;
      }
  return others / elements;
}

// After correcting a wrong camera, depth fits at the true poses as well as with the correct camera
// from the start.
TEST(HeldOut, SurfacesAreSeenThroughTheCameraThatIsRefined) {
  TexturedScan scan = bare_ground(3);
  std::map<int, Pose> truth;
  for (int n = 0; n < 3; ++n) truth[n + 1] = around(10.0 * n);
  std::vector<libmap::FeatureLink> links(2);
  links[0].frames = {0, 1};
  links[1].frames = {1, 2};
  const auto right = libmap::find_features(scan, {1, 2, 3});
  const libmap::IntrinsicsStep wrong_by{0.02, 0.015, 4.0, -3.0};
  const libmap::IntrinsicsStep step{1.0 / 1.02 - 1.0, 1.0 / 1.015 - 1.0, -4.0, 3.0};
  for (auto& [node, frame] : scan.frames)
    frame.cameras = {libmap::moved(frame.cameras[0], wrong_by)};
  auto found = libmap::find_features(scan, {1, 2, 3});
  const auto wrong = libmap::surface_costs(found.frames, links, truth);
  for (libmap::FrameFeatures& frame : found.frames)
    libmap::calibrate(frame, {.intrinsics = {step}});
  const auto put_right = libmap::surface_costs(found.frames, links, truth);
  const auto from_start = libmap::surface_costs(right.frames, links, truth);
  EXPECT_GT(libmap::compare_held_out(wrong, put_right).count, 50U);
  const auto gain = libmap::compare_held_out(wrong, put_right);
  EXPECT_LT(gain.after, 0.5 * gain.before);
  const auto same = libmap::compare_held_out(from_start, put_right);
  EXPECT_NEAR(same.after, same.before, 0.02 * same.before);
  EXPECT_LT(fraction_of_other_elements(found.frames, right.frames), 0.02);
}

// Corrected surfaces equal the surfaces of corrected images.
TEST(HeldOut, SurfacesTurnWithTheCorrectionOfDepth) {
  TexturedScan scan = bare_ground(2);
  libmap::DepthCorrection correction{0.5, 0.25, {}, {0.01, -0.004, 0.006}};
  for (int n = 0; n < 14; ++n) correction.spline_m.push_back(0.01 * std::sin(0.8 * n));
  auto found = libmap::find_features(scan, {1, 2});
  for (auto& [node, frame] : scan.frames) libmap::correct_depth(frame.depth, correction);
  const auto wanted = libmap::find_features(scan, {1, 2});
  EXPECT_GT(fraction_of_other_elements(found.frames, wanted.frames), 0.5);
  for (libmap::FrameFeatures& frame : found.frames)
    libmap::calibrate(frame, {.depth = {correction}});
  EXPECT_LT(fraction_of_other_elements(found.frames, wanted.frames), 0.05);
}

}  // namespace held_out_test
