#include "libmap/optimize/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/parallel.h"
#include "tests/libmap/optimize/bundle_scenes.h"
#include "tests/support/test_support.h"

namespace bundle_adjustment_test {

using graspmap_test::error_of;
using graspmap_test::error_of_poses;
using graspmap_test::is_error;
using graspmap_test::random_points;
using graspmap_test::random_step;
using graspmap_test::Scene;
using graspmap_test::scene_of;
using graspmap_test::Way;
using graspmap_test::way_with_rows;
using libmap::FrameFeatures;
using libmap::Pose;

TEST(BundleAdjustment, RecoversAnExactScene) {
  const Scene scene = scene_of(6, {});
  const auto result =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, {}, scene.components);
  EXPECT_TRUE(result.converged);
  EXPECT_GT(error_of_poses(scene, scene.start), 5e-3);
  EXPECT_LT(error_of_poses(scene, result.map_from_base), 2e-6);
  EXPECT_LT(result.reprojection_rms_px, 1e-3);
  EXPECT_EQ(result.tracks, 150U);
}

TEST(BundleAdjustment, ImpossibleCamerasExceedTheirBounds) {
  const libmap::BundleAdjustmentOptions options;
  const auto exceeds = [&](const libmap::SensorCalibration& calibration) {
    return libmap::exceeded_bound(calibration, options).has_value();
  };
  EXPECT_FALSE(exceeds({}));
  EXPECT_FALSE(exceeds({.timing = {{-0.02, 0.03}}}));
  EXPECT_TRUE(exceeds({.timing = {{-0.034, 0.0}}}));
  EXPECT_TRUE(exceeds({.timing = {{0.0, 0.132}}}));
  EXPECT_FALSE(exceeds({.intrinsics = {{0.03, -0.03, 8.0, 0.0}}}));
  EXPECT_TRUE(exceeds({.intrinsics = {{0.09, 0.0, 0.0, 0.0}}}));
  EXPECT_TRUE(exceeds({.intrinsics = {{0.0, 0.0, 0.0, -33.0}}}));
  libmap::Pose far = libmap::Pose::Identity();
  far.translation().x() = 0.09;
  EXPECT_TRUE(exceeds({.color_from_depth = {far}}));
  // 10 mm and 2 % of the range, at 1 and 3 m.
  const auto bent = [](double at_1_m, double at_3_m) {
    const double step = 0.5 * (at_3_m - at_1_m);
    libmap::DepthCorrection depth{1.0, 1.0, {}, {}};
    for (int n = -1; n <= 3; ++n) depth.spline_m.push_back(at_1_m + n * step);
    return libmap::SensorCalibration{.depth = {depth}};
  };
  EXPECT_FALSE(exceeds(bent(0.029, 0.069)));
  EXPECT_TRUE(exceeds(bent(0.031, 0.0)));
  EXPECT_TRUE(exceeds(bent(0.0, -0.071)));
  libmap::SensorCalibration corners = bent(0.0, 0.0);
  corners.depth[0].radial[0] = 0.04;
  EXPECT_TRUE(exceeds(corners));
}

// A few outlying depths do not extend the correction: it is constant beyond the 1 % quantiles.
TEST(BundleAdjustment, CorrectionsReachAsFarAsMostDepths) {
  std::vector<FrameFeatures> frames(1);
  for (int n = 0; n < 1000; ++n) {
    libmap::Feature feature;
    feature.depth_m = n < 3 ? 9.0F : n < 6 ? 0.2F : 1.0F + 0.002F * static_cast<float>(n);
    frames[0].features.push_back(feature);
  }
  libmap::DepthCorrection depth = libmap::corrections_for(frames, 1, 0.2).at(0);
  EXPECT_NEAR(depth.first_m, 1.02, 0.02);
  EXPECT_NEAR(depth.last_m(), 2.98, 0.02);
  std::fill(depth.spline_m.begin(), depth.spline_m.end(), 0.01);
  depth.spline_m.back() = 0.05;
  depth.radial = {0.0, 0.0, 0.01};
  EXPECT_EQ(depth.at(9.0, 1.0), depth.at(depth.last_m(), 1.0));
  EXPECT_EQ(depth.at(0.2, 1.0), depth.at(depth.first_m, 1.0));
}

TEST(BundleAdjustment, OptionsOutOfTheirRangesAreNamed) {
  const auto refusal = [](const libmap::BundleAdjustmentOptions& options) {
    return error_of([&] {
      libmap::adjust_bundle({}, std::vector<libmap::FeatureTrack>{}, {}, {}, {}, options);
    });
  };
  EXPECT_TRUE(is_error(refusal({.robust_scale = 0.0}),
                       {.field = "observation_scale", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refusal({.max_iterations = 0}),
                       {.field = "bundle_iterations", .value = "0", .bound = ">= 1 and <= 10000"}));
}

TEST(BundleAdjustment, InformationIsThatOfTheErrors) {
  double sum = 0.0;
  constexpr int trials = 30;
  for (int n = 0; n < trials; ++n) {
    const Scene scene = scene_of(4, {.apply = true});
    libmap::BundleAdjustmentOptions options;
    options.robust_scale = 1e3;
    const auto result = libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, {},
                                              scene.components, options);
    for (std::size_t a = 1; a < 4; ++a)
      for (std::size_t b = 1; b < 4; ++b) {
        const auto step = [&](std::size_t place) {
          const int node = static_cast<int>(place) + 1;
          return libmap::step_between(scene.truth.at(node), result.map_from_base.at(node));
        };
        sum += step(a).dot(result.information.block(a, b) * step(b));
      }
  }
  // Three free poses: chi-square with eighteen degrees of freedom.
  EXPECT_NEAR(sum / trials, 18.0, 4.0);
}

TEST(BundleAdjustment, FindsAShiftedPrincipalPoint) {
  const Scene scene = scene_of(8, {});
  std::vector<FrameFeatures> frames = scene.frames;
  for (FrameFeatures& frame : frames)  // shifts images by 0.4 px right and 0.3 px up
    libmap::calibrate(frame, {.intrinsics = {{0.0, 0.0, -0.4, 0.3}}});
  for (FrameFeatures& frame : frames) frame.cameras = {graspmap_test::feature_camera()};
  libmap::BundleAdjustmentOptions options;
  const auto held =
      libmap::adjust_bundle(frames, scene.tracks, scene.start, {}, scene.components, options);
  options.refine_intrinsics = true;
  options.max_iterations = 100;
  const auto free =
      libmap::adjust_bundle(frames, scene.tracks, scene.start, {}, scene.components, options);
  ASSERT_EQ(free.calibration.intrinsics.size(), 1U);
  EXPECT_NEAR(free.calibration.intrinsics[0].cx_px, 0.4, 0.05);
  EXPECT_NEAR(free.calibration.intrinsics[0].cy_px, -0.3, 0.05);
  EXPECT_LT(free.final_cost, 0.2 * held.final_cost);
  EXPECT_LT(error_of_poses(scene, free.map_from_base), error_of_poses(scene, held.map_from_base));
}

// Errors of the calibration are consistent with the alternatives.
TEST(BundleAdjustment, AlternativesAreAsFarAsTheTruth) {
  double sum = 0.0;
  constexpr int trials = 30;
  for (int n = 0; n < trials; ++n) {
    const Scene scene = scene_of(4, {.apply = true});
    libmap::BundleAdjustmentOptions options;
    options.robust_scale = 1e3;
    options.refine_intrinsics = true;
    options.alternatives = 4;
    const auto result = libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, {},
                                              scene.components, options);
    const auto numbers = [](const libmap::SensorCalibration& calibration) {
      const libmap::IntrinsicsStep& step = calibration.intrinsics.at(0);
      return Eigen::Vector4d(step.fx_relative, step.fy_relative, step.cx_px, step.cy_px);
    };
    ASSERT_EQ(result.alternatives.size(), 4U);
    Eigen::Matrix4d deviations;
    for (int k = 0; k < 4; ++k)
      deviations.col(k) =
          numbers(result.alternatives[static_cast<std::size_t>(k)]) - numbers(result.calibration);
    sum += deviations.fullPivLu().solve(numbers(result.calibration)).squaredNorm();
  }
  // Four parameters with true value 0: chi-square with four degrees of freedom.
  EXPECT_NEAR(sum / trials, 4.0, 1.5);
}

// A depth error over range and radius together with focal lengths that are 1 % off: both are found,
// except for the scale, which is not observable.
TEST(BundleAdjustment, TellsBentDepthFromAFalseFocalLength) {
  const Scene scene = scene_of(12, {});
  std::vector<FrameFeatures> frames = scene.frames;
  const auto measured = [](double z, double radius2) {
    return 1.008 * z + 0.004 * std::sin(2.0 * M_PI * z / 1.2) + 0.006 * radius2;
  };
  double before = 0.0;
  for (FrameFeatures& frame : frames) {
    for (libmap::Feature& feature : frame.features) {
      const Eigen::Vector2d pixel =
          libmap::distort_to_pixel(frame.cameras[0], feature.ray.cast<double>());
      const double z = feature.depth_m;
      feature.depth_m = static_cast<float>(
          measured(z, libmap::squared_image_radius(512, 424, pixel.x(), pixel.y())));
      before = std::max(before, std::abs(feature.depth_m / z / 1.008 - 1.0));
    }
    libmap::calibrate(frame, {.intrinsics = {{0.01, 0.01, 4.0, 0.0}}});
  }
  libmap::BundleAdjustmentOptions options;
  options.refine_intrinsics = true;
  options.refine_depth = true;
  options.max_iterations = 100;
  const auto found =
      libmap::adjust_bundle(frames, scene.tracks, scene.start, {}, scene.components, options);
  ASSERT_EQ(found.calibration.depth.size(), 1U);
  EXPECT_NEAR(found.calibration.intrinsics[0].fx_relative, 1.0 / 1.01 - 1.0, 1e-3);
  EXPECT_NEAR(found.calibration.intrinsics[0].fy_relative, 1.0 / 1.01 - 1.0, 1e-3);
  EXPECT_NEAR(found.calibration.intrinsics[0].cx_px, -4.0, 0.3);
  double sum = 0.0;
  double squares = 0.0;
  double gauge = 0.0;
  double count = 0.0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    FrameFeatures corrected = frames[f];
    libmap::calibrate(corrected, {.depth = found.calibration.depth});
    for (std::size_t n = 0; n < corrected.features.size(); ++n) {
      const double ratio = corrected.features[n].depth_m / scene.frames[f].features[n].depth_m;
      gauge += corrected.features[n].depth_m / frames[f].features[n].depth_m - 1.0;
      sum += ratio;
      squares += ratio * ratio;
      count += 1.0;
    }
  }
  const double spread = std::sqrt(squares / count - (sum / count) * (sum / count));
  EXPECT_GT(before, 5e-3);
  EXPECT_LT(spread, 5e-4);
  EXPECT_NEAR(gauge / count, 0.0, 1e-6) << "the mean scale is the depth camera's";
  EXPECT_NEAR(sum / count, 1.008, 5e-3);
}

TEST(BundleAdjustment, FindsTheTimeOfTheImagesRows) {
  const auto points = random_points(150);
  const Way way = way_with_rows(points, 0.06);
  libmap::BundleAdjustmentOptions options;
  options.max_iterations = 100;
  const auto held =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  options.refine_timing = true;
  const auto free =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  ASSERT_EQ(free.calibration.timing.size(), 1U);
  EXPECT_NEAR(free.calibration.timing[0].rolling_shutter_s, 0.06, 0.006);
  EXPECT_EQ(free.calibration.motion.size(), way.frames.size());
  // At 0.3 s the base moves with about 0.6 cos(0.45) m/s along its y axis.
  EXPECT_NEAR(free.calibration.motion.at(1).y(), 0.54, 0.08);
  EXPECT_LT(free.final_cost, 0.01 * held.final_cost);
  // Calibrated frames fit as with a global shutter.
  FrameFeatures calibrated = way.frames[4];
  libmap::calibrate(calibrated, free.calibration);
  const Way exact = way_with_rows(points, 0.0);
  double before = 0.0;
  double after = 0.0;
  for (std::size_t n = 0; n < calibrated.features.size(); ++n) {
    const Eigen::Vector2f& wanted = exact.frames[4].features[n].ray;
    before += (way.frames[4].features[n].ray - wanted).norm();
    after += (calibrated.features[n].ray - wanted).norm();
  }
  EXPECT_LT(after, 0.5 * before);
}

// Starts far from the truth, with free motions and times.
TEST(BundleAdjustment, IsTheSameForAnyNumberOfThreadsAndNeverWorse) {
  const Way way = way_with_rows(random_points(700), 0.06);
  std::map<int, Pose> start = way.truth;
  for (auto& [node, pose] : start) pose = libmap::moved(pose, random_step(0.03, 0.02));
  const auto adjusted = [&](unsigned threads, int steps) {
    const libmap::ThreadLimit limit(threads);
    libmap::BundleAdjustmentOptions options;
    options.refine_timing = options.refine_intrinsics = true;
    options.max_iterations = steps;
    return libmap::adjust_bundle(way.frames, way.tracks, start, {}, way.components, options);
  };
  double cost = adjusted(1, 1).initial_cost;
  for (int steps = 1; steps < 8; ++steps) {
    const auto one = adjusted(1, steps);
    const auto three = adjusted(3, steps);
    EXPECT_LE(one.final_cost, cost) << steps;
    cost = one.final_cost;
    EXPECT_EQ(one.final_cost, three.final_cost);
    EXPECT_EQ(one.calibration.timing[0].rolling_shutter_s,
              three.calibration.timing[0].rolling_shutter_s);
    for (const auto& [node, pose] : one.map_from_base)
      EXPECT_EQ(pose.matrix(), three.map_from_base.at(node).matrix());
  }
}

TEST(BundleAdjustment, FindsNoTimeWhereRowsAreExposedAtOnce) {
  const Way way = way_with_rows(random_points(150), 0.0);
  libmap::BundleAdjustmentOptions options;
  options.refine_timing = true;
  const auto found =
      libmap::adjust_bundle(way.frames, way.tracks, way.truth, {}, way.components, options);
  EXPECT_NEAR(found.calibration.timing.at(0).rolling_shutter_s, 0.0, 1e-4);
  EXPECT_NEAR(found.calibration.timing.at(0).depth_delay_s, 0.0, 1e-4);
}

}  // namespace bundle_adjustment_test
