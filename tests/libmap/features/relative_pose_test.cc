#include "libmap/features/relative_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "libmap/features/match_loops.h"
#include "tests/libmap/features/synthetic_features.h"
#include "tests/support/test_support.h"

namespace relative_pose_test {

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
  // Two equal descriptors: neither passes the ratio test.
  std::copy_n(b.descriptors.begin(), 128, b.descriptors.begin() + 128);
  const auto matches = libmap::match_features(vectors, libmap::descriptor_vectors(b), 0.8);
  EXPECT_EQ(matches.size(), 48U);
  EXPECT_EQ(matches.front(), (FeatureMatch{2, 2}));
  EXPECT_TRUE(libmap::match_features(vectors, Eigen::MatrixXf(128, 0), 0.8).empty());
}

// Random unit vectors; some are equal, and values are coarse, so that products are equal too.
Eigen::MatrixXf coarse_vectors(Eigen::Index count) {
  Eigen::MatrixXf vectors(16, count);
  for (Eigen::Index n = 0; n < vectors.size(); ++n)
    vectors(n % 16, n / 16) = uniform(0, 1) < 0.5 ? -0.25F : 0.25F;
  if (count > 5) vectors.col(5) = vectors.col(2);
  return vectors;
}

std::vector<FeatureMatch> matches_by_definition(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                                                double max_ratio) {
  std::vector<FeatureMatch> matches;
  const Eigen::MatrixXf products = b.transpose() * a;
  for (Eigen::Index n = 0; n < a.cols(); ++n) {
    Eigen::Index nearest = 0;
    Eigen::Index back = 0;
    const float best = products.col(n).maxCoeff(&nearest);
    float next = -2.0F;
    for (Eigen::Index m = 0; m < b.cols(); ++m)
      if (m != nearest) next = std::max(next, products(m, n));
    products.row(nearest).maxCoeff(&back);
    const double ratio = std::sqrt(static_cast<double>((1.0F - best) / (1.0F - next)));
    if (back == n && (max_ratio >= 1.0 || ratio < max_ratio))
      matches.push_back({static_cast<int>(n), static_cast<int>(nearest)});
  }
  return matches;
}

// For numbers that fill registers and steps, or not.
TEST(MatchFeatures, EqualsItsDefinition) {
  for (const Eigen::Index a_count : {1, 2, 3, 4, 7, 64, 101})
    for (const Eigen::Index b_count : {1, 2, 15, 31, 32, 33, 100}) {
      const Eigen::MatrixXf a = coarse_vectors(a_count);
      const Eigen::MatrixXf b = coarse_vectors(b_count);
      for (const double max_ratio : {0.8, 1.0})
        EXPECT_EQ(libmap::match_features(a, b, max_ratio), matches_by_definition(a, b, max_ratio))
            << a_count << " " << b_count;
    }
}

TEST(MatchLoops, AllInstructionSetsYieldTheSame) {
  constexpr int size = 24;
  constexpr int a_count = 3 * libmap::MatchLoops::group;
  constexpr int b_count = 2 * libmap::MatchLoops::lanes;
  std::vector<float> a(size * a_count);
  std::vector<float> b(size * b_count);
  std::vector<float> bias(b_count, 0.0F);
  std::fill(bias.end() - 9, bias.end(), -4.0F);
  for (std::vector<float>* values : {&a, &b})
    for (float& value : *values) value = static_cast<float>(uniform(-0.2, 0.2));
  const auto found_with = [&](libmap::InstructionSet instructions) {
    std::vector<float> numbers(2 * a_count + b_count, -2.0F);
    std::vector<int> indices(a_count + b_count, -1);
    libmap::match_loops_of(instructions)
        .find_nearest({a.data(), b.data(), bias.data(), size, a_count, b_count},
                      {numbers.data(), numbers.data() + a_count, indices.data(),
                       numbers.data() + 2 * a_count, indices.data() + a_count});
    return std::pair(numbers, indices);
  };
  const auto truth = found_with(libmap::InstructionSet::portable);
  EXPECT_EQ(truth.second.back(), -1);
  for (const auto set : {libmap::InstructionSet::avx2, libmap::InstructionSet::avx512})
    if (libmap::has_instruction_set(set)) {
      EXPECT_EQ(found_with(set), truth);
    }
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

// With the stated noise, squared errors have a chi-square distribution with six degrees of freedom.
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
  // All features on one line of the image.
  for (Eigen::Vector3d& point : points) point = {1.5, uniform(-0.8, 0.8), 0.02};
  const FrameFeatures on_line = see_points(1, Pose::Identity(), points);
  const FrameFeatures from_elsewhere = see_points(2, motion, points);
  EXPECT_NE(
      libmap::estimate_relative_pose(on_line, from_elsewhere, same_numbers(60), {}, 1).outcome,
      RelativePoseOutcome::found);
}

}  // namespace relative_pose_test
