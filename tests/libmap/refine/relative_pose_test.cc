#include "libmap/refine/relative_pose.h"

#include <gtest/gtest.h>

#include "libmap/core/parallel.h"
#include "libmap/refine/bundle_adjustment.h"
#include "libmap/refine/feature_tracks.h"
#include "libmap/refine/link_terms.h"
#include "libmap/refine/loop_closure.h"
#include "libmap/refine/sparse_adjustment.h"
#include "tests/libmap/refine/synthetic_features.h"
#include "tests/support/test_support.h"

namespace relative_pose_test {

using graspmap_test::error_of;
using graspmap_test::random_points;
using graspmap_test::random_step;
using graspmap_test::same_numbers;
using graspmap_test::see_points;
using graspmap_test::uniform;
using libmap::FeatureMatch;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::RelativePose;
using libmap::RelativePoseOutcome;
using libmap::Vector6d;

Pose some_motion() { return libmap::moved(Pose::Identity(), random_step(0.3, 0.2)); }

TEST(MatchFeatures, FindsEachOnesBestAndLeavesDoubtfulOnesOut) {
  const auto points = random_points(50);
  const FrameFeatures a = see_points(1, Pose::Identity(), points);
  FrameFeatures b = see_points(2, some_motion(), points);
  const auto vectors = libmap::descriptor_vectors(a);
  EXPECT_EQ(libmap::match_features(vectors, libmap::descriptor_vectors(b), 0.8), same_numbers(50));
  // Twice the same descriptor: neither is clearly the best.
  std::copy_n(b.descriptors.begin(), 128, b.descriptors.begin() + 128);
  const auto matches = libmap::match_features(vectors, libmap::descriptor_vectors(b), 0.8);
  EXPECT_EQ(matches.size(), 48U);
  EXPECT_EQ(matches.front(), (FeatureMatch{2, 2}));
  EXPECT_TRUE(libmap::match_features(vectors, Eigen::MatrixXf(128, 0), 0.8).empty());
}

// What descriptors say does not depend on the cameras: the second time it is not asked for.
TEST(VerifyPairs, KnownMatchesStandForDescriptors) {
  const auto points = random_points(80);
  std::vector<FrameFeatures> frames = {see_points(1, Pose::Identity(), points),
                                       see_points(2, some_motion(), points)};
  const auto links = [&](libmap::KnownMatches* known) {
    return libmap::verify_pairs(frames, {{0, 1}}, {}, 1, libmap::no_progress(), known).links;
  };
  const auto expected = links(nullptr);
  ASSERT_EQ(expected.size(), 1U);
  libmap::KnownMatches known;
  for (int time = 0; time < 2; ++time) {
    const auto found = links(&known);
    ASSERT_EQ(found.size(), 1U) << time;
    EXPECT_EQ(found[0].matches, expected[0].matches);
    EXPECT_EQ(found[0].held_out, expected[0].held_out);
    EXPECT_EQ(found[0].link.from_from_to.matrix(), expected[0].link.from_from_to.matrix());
    for (FrameFeatures& frame : frames)
      std::fill(frame.descriptors.begin(), frame.descriptors.end(), 1);
  }
  EXPECT_TRUE(links(nullptr).empty()) << "descriptors that say nothing";
}

TEST(RelativePose, ExactMatchesGiveTheExactMotionDespiteOutliers) {
  const auto points = random_points(120);
  const Pose motion = some_motion();
  const FrameFeatures a = see_points(1, Pose::Identity(), points);
  const FrameFeatures b = see_points(2, motion, points);
  std::vector<FeatureMatch> matches = same_numbers(120);
  for (std::size_t n = 0; n < 48; ++n) matches[n].b = static_cast<int>((n + 17) % 120);
  const RelativePose pose = libmap::estimate_relative_pose(a, b, matches, {}, 3);
  ASSERT_EQ(pose.outcome, RelativePoseOutcome::found);
  EXPECT_LT(libmap::step_between(motion, pose.a_from_b).norm(), 1e-5);
  EXPECT_EQ(pose.inliers.size(), 72U);
}

// With the stated noise the squared errors are chi-square of six.
TEST(RelativePose, CovarianceIsThatOfTheErrors) {
  double sum = 0.0;
  constexpr int trials = 200;
  for (int n = 0; n < trials; ++n) {
    const auto points = random_points(80);
    const Pose motion = some_motion();
    const FrameFeatures a = see_points(1, Pose::Identity(), points, {.apply = true});
    const FrameFeatures b = see_points(2, motion, points, {.apply = true});
    const RelativePose pose = libmap::estimate_relative_pose(a, b, same_numbers(80), {}, 1);
    ASSERT_EQ(pose.outcome, RelativePoseOutcome::found);
    const Vector6d error = libmap::step_between(motion, pose.a_from_b);
    sum += error.dot(pose.information * error);
  }
  EXPECT_GT(sum / trials, 4.0);
  EXPECT_LT(sum / trials, 8.0);
}

TEST(RelativePose, JacobianIsTheDerivative) {
  const auto points = random_points(5);
  const Pose motion = some_motion();
  const FrameFeatures a = see_points(1, Pose::Identity(), points, {.apply = true});
  const FrameFeatures b = see_points(2, motion, points, {.apply = true});
  for (const FeatureMatch& match : same_numbers(5)) {
    const auto at = libmap::match_residual(a, b, match, motion, true);
    for (int n = 0; n < 6; ++n) {
      const Vector6d step = 1e-6 * Vector6d::Unit(n);
      const Eigen::Vector3d difference =
          libmap::match_residual(a, b, match, libmap::moved(motion, step)).residual -
          libmap::match_residual(a, b, match, libmap::moved(motion, -step)).residual;
      EXPECT_LT((difference / 2e-6 - at.jacobian.col(n)).norm(), 1e-4 * at.jacobian.col(n).norm());
    }
  }
}

TEST(RelativePose, RefusesTooLittle) {
  auto points = random_points(60);
  const Pose motion = some_motion();
  const FrameFeatures a = see_points(1, Pose::Identity(), points);
  const FrameFeatures b = see_points(2, motion, points);
  EXPECT_EQ(libmap::estimate_relative_pose(a, b, same_numbers(20), {}, 1).outcome,
            RelativePoseOutcome::too_few_matches);
  std::vector<FeatureMatch> shuffled = same_numbers(60);
  for (std::size_t n = 0; n < 60; ++n) shuffled[n].b = static_cast<int>((7 * n + 11) % 60);
  EXPECT_EQ(libmap::estimate_relative_pose(a, b, shuffled, {}, 1).outcome,
            RelativePoseOutcome::too_few_inliers);
  // All on one line of the picture.
  for (Eigen::Vector3d& point : points) point = {1.5, uniform(-0.8, 0.8), 0.02};
  const FrameFeatures on_line = see_points(1, Pose::Identity(), points);
  const FrameFeatures from_elsewhere = see_points(2, motion, points);
  EXPECT_NE(
      libmap::estimate_relative_pose(on_line, from_elsewhere, same_numbers(60), {}, 1).outcome,
      RelativePoseOutcome::found);
}

TEST(FeatureTracks, JoinsMatchesAndLeavesConflictsOut) {
  const auto points = random_points(30);
  std::vector<FrameFeatures> frames;
  for (int node = 1; node <= 3; ++node) frames.push_back(see_points(node, some_motion(), points));
  const auto linked = [&](std::size_t a, std::size_t b) {
    libmap::FeatureLink link;
    link.frames = {a, b};
    link.link.from_from_to = Pose::Identity();
    link.matches = same_numbers(30);
    return link;
  };
  std::vector<libmap::FeatureLink> links = {linked(0, 1), linked(1, 2)};
  // The first and the last frame have no link: no track joins them.
  const libmap::FeatureTracks apart =
      libmap::build_tracks(frames, links, libmap::TrackFrames::linked);
  EXPECT_EQ(apart.tracks.size(), 30U);
  EXPECT_EQ(apart.split, 30U);
  for (const auto& track : apart.tracks) EXPECT_EQ(track.observations.size(), 2U);
  libmap::FeatureTracks tracks = libmap::build_tracks(frames, links);
  ASSERT_EQ(tracks.tracks.size(), 30U);
  EXPECT_EQ(tracks.conflicts, 0U);
  for (const auto& track : tracks.tracks) EXPECT_EQ(track.observations.size(), 3U);
  links.push_back(linked(0, 2));
  links.back().matches = {{4, 5}};
  EXPECT_GE(libmap::build_tracks(frames, links).conflicts, 1U);
}

struct Scene {
  std::map<int, Pose> truth;
  std::map<int, Pose> start;
  std::vector<FrameFeatures> frames;
  std::vector<libmap::FeatureTrack> tracks;
  std::vector<libmap::GraphComponent> components;
};

Scene scene_of(int frames, const graspmap_test::FeatureNoise& noise,
               const libmap::Camera& camera = graspmap_test::feature_camera()) {
  Scene scene;
  const auto points = random_points(150);
  scene.components = {{{}, 1}};
  for (int node = 1; node <= frames; ++node) {
    const Pose pose = libmap::moved(Pose::Identity(), random_step(0.4, 0.2));
    scene.truth[node] = pose;
    scene.start[node] = node == 1 ? pose : libmap::moved(pose, random_step(0.01, 0.01));
    scene.frames.push_back(see_points(node, pose, points, noise, camera));
    scene.components[0].nodes.push_back(node);
  }
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    libmap::FeatureTrack track;
    for (std::uint32_t f = 0; f < scene.frames.size(); ++f)
      if ((n + f) % 3 != 0) track.observations.push_back({f, n});
    scene.tracks.push_back(track);
  }
  return scene;
}

double error_of_poses(const Scene& scene, const std::map<int, Pose>& poses) {
  double largest = 0.0;
  for (const auto& [node, pose] : scene.truth)
    largest = std::max(largest, libmap::step_between(pose, poses.at(node)).norm());
  return largest;
}

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

TEST(SparseAdjustment, FindsTheOptimumOfTheGeneralSolver) {
  const Scene scene = scene_of(7, {.apply = true});
  std::vector<libmap::GraphLinkResult> links;
  for (int node = 1; node < 7; ++node) {
    libmap::PoseLink link{.from = node, .to = node + 1};
    link.from_from_to = libmap::moved(scene.truth.at(node).inverse() * scene.truth.at(node + 1),
                                      random_step(0.003, 0.003));
    link.information = 1e5 * libmap::Matrix6d::Identity();
    links.push_back({link, false, 0.5, 0.0});
  }
  links.push_back(links.front());
  links.back().link.from_from_to = Pose::Identity();
  links.back().rejected = true;
  const auto general =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, links, scene.components);
  const auto sparse =
      libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
  EXPECT_TRUE(sparse.converged);
  EXPECT_NEAR(sparse.final_cost, general.final_cost, 1e-5 * general.final_cost);
  EXPECT_EQ(sparse.observations, general.observations);
  EXPECT_EQ(sparse.tracks, general.tracks);
  EXPECT_NEAR(sparse.reprojection_rms_px, general.reprojection_rms_px, 1e-4);
  for (const auto& [node, pose] : general.map_from_base)
    EXPECT_LT(libmap::step_between(pose, sparse.map_from_base.at(node)).norm(), 5e-5);
  EXPECT_EQ(sparse.map_from_base.at(1).matrix(), scene.start.at(1).matrix());
  for (std::size_t a = 0; a < 7; ++a)
    EXPECT_LT((sparse.information.block(a, a) - general.information.block(a, a)).norm(),
              1e-3 * general.information.block(a, a).norm());
  for (const unsigned threads : {1U, 3U}) {
    const libmap::ThreadLimit limit(threads);
    const auto again =
        libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
    for (const auto& [node, pose] : sparse.map_from_base)
      EXPECT_EQ(again.map_from_base.at(node).matrix(), pose.matrix());
  }
}

// Gravity and priors of single nodes: their normal equations are those of differences of the cost,
// which both solvers minimize.
TEST(LinkTerms, AbsoluteLinksBindTheirNodes) {
  const Scene scene = scene_of(4, {.apply = true});
  std::vector<libmap::GraphLinkResult> links;
  for (const libmap::LinkType type : {libmap::LinkType::gravity, libmap::LinkType::pose_prior}) {
    libmap::PoseLink link{.from = 2, .to = 2, .type = type};
    link.from_from_to = libmap::moved(scene.start.at(2), random_step(0.02, 0.02));
    link.information = 1e6 * libmap::Matrix6d::Identity();
    links.push_back({link, false, 1.0, 0.0});
    const std::vector<libmap::GraphLinkResult> own = {links.back()};
    const libmap::BlockSystem system = libmap::all_link_system(scene.start, own);
    constexpr double step = 1e-6;
    for (Eigen::Index n = 0; n < 6; ++n) {
      const auto cost_after = [&](double by) {
        std::map<int, Pose> poses = scene.start;
        poses.at(2) = libmap::moved(poses.at(2), by * libmap::Vector6d::Unit(n));
        return libmap::link_cost(poses, own);
      };
      const double slope = (cost_after(step) - cost_after(-step)) / (2.0 * step);
      EXPECT_NEAR(-system.side()[1][n], slope, 0.02 * system.side()[1].norm()) << n;
    }
  }
  const auto dense =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, links, scene.components);
  const auto sparse =
      libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
  const auto without =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, {}, scene.components);
  EXPECT_LT(libmap::step_between(dense.map_from_base.at(2), sparse.map_from_base.at(2)).norm(),
            1e-4);
  EXPECT_GT(libmap::step_between(dense.map_from_base.at(2), without.map_from_base.at(2)).norm(),
            1e-3);
}

TEST(SparseAdjustment, RecoversAnExactSceneAndNeverWorsens) {
  const Scene scene = scene_of(6, {});
  const auto result = libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, {},
                                            scene.components, {.max_iterations = 60});
  EXPECT_LT(error_of_poses(scene, result.map_from_base), 2e-6);
  const auto one_step = libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, {},
                                              scene.components, {.max_iterations = 1});
  EXPECT_LE(one_step.final_cost, one_step.initial_cost);
  EXPECT_EQ(one_step.iterations, 1);
}

TEST(BundleAdjustment, OptionsOutOfTheirRangesAreNamed) {
  const auto refusal = [](const libmap::BundleAdjustmentOptions& options) {
    return std::string(error_of([&] {
                         libmap::adjust_bundle({}, std::vector<libmap::FeatureTrack>{}, {}, {}, {},
                                               options);
                       }).what());
  };
  EXPECT_EQ(refusal({.robust_scale = 0.0}), "observation_scale is 0: out of range (must be > 0)");
  EXPECT_EQ(refusal({.max_iterations = 0}),
            "bundle_iterations is 0: out of range (must be >= 1 and <= 10000)");
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
  // Three free poses: chi-square of eighteen.
  EXPECT_NEAR(sum / trials, 18.0, 4.0);
}

TEST(BundleAdjustment, FindsAShiftedPrincipalPoint) {
  const Scene scene = scene_of(8, {});
  std::vector<FrameFeatures> frames = scene.frames;
  for (FrameFeatures& frame : frames)  // as if pictures lay 0.4 px right and 0.3 px up
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

// The errors of the calibration are as large as the alternatives to it say.
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
      return Eigen::Vector4d(step.fx_share, step.fy_share, step.cx_px, step.cy_px);
    };
    ASSERT_EQ(result.alternatives.size(), 4U);
    Eigen::Matrix4d deviations;
    for (int k = 0; k < 4; ++k)
      deviations.col(k) =
          numbers(result.alternatives[static_cast<std::size_t>(k)]) - numbers(result.calibration);
    sum += deviations.fullPivLu().solve(numbers(result.calibration)).squaredNorm();
  }
  // Four numbers, whose truth is 0: chi-square of four.
  EXPECT_NEAR(sum / trials, 4.0, 1.5);
}

// Depth that bends with range and toward the corners, and focal lengths that are 1 % off: both are
// found together, but for the scale, which nothing tells.
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
  EXPECT_NEAR(found.calibration.intrinsics[0].fx_share, 1.0 / 1.01 - 1.0, 1e-3);
  EXPECT_NEAR(found.calibration.intrinsics[0].fy_share, 1.0 / 1.01 - 1.0, 1e-3);
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

// Ten matches are too few for a link, and enough to say where to look.
TEST(GuessMotion, TakesFewMatches) {
  const auto points = graspmap_test::random_points(10);
  const Pose truth = graspmap_test::beside(0.0).inverse() * graspmap_test::beside(0.1);
  const std::vector<FrameFeatures> frames = {
      graspmap_test::see_points(1, graspmap_test::beside(0.0), points),
      graspmap_test::see_points(2, graspmap_test::beside(0.1), points)};
  EXPECT_TRUE(libmap::verify_pairs(frames, {{0, 1}}, {}, 1).links.empty());
  const auto guess = libmap::guess_motion(frames, {0, 1}, {}, 1);
  ASSERT_TRUE(guess);
  EXPECT_LT(libmap::step_between(truth, *guess).norm(), 1e-3);
  const std::vector<FrameFeatures> blank = {frames[0], graspmap_test::see_points(2, truth, {})};
  EXPECT_FALSE(libmap::guess_motion(blank, {0, 1}, {}, 1));
}

}  // namespace relative_pose_test
