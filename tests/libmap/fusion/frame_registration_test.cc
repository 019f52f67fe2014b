#include "libmap/fusion/frame_registration.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/core/parallel.h"
#include "libmap/fusion/depth_fusion.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace frame_registration_test {

using graspmap_test::box;
using graspmap_test::DepthNoiseModel;
using graspmap_test::looking;
using graspmap_test::MemoryScan;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using graspmap_test::Surface;
using graspmap_test::uniform;

// Ground with boulders and a block, which determines all six degrees of freedom.
Surface rocky_ground() {
  return nearest_of({plane_z(0), sphere({0.3, 0.1, 0.05}, 0.2), sphere({-0.3, 0.2, 0.0}, 0.15),
                     box({-0.2, -0.4, 0}, {0.1, -0.2, 0.2})});
}

MemoryScan ring_scan(const Surface& surface, int views) {
  MemoryScan scan;
  for (int n = 0; n < views; ++n) {
    const double angle = 2 * std::numbers::pi * n / views;
    scan.see(surface, looking({std::cos(angle), std::sin(angle), 1.0}, {0, 0, 0.05}),
             small_camera(), {0.002, 0.002}, random_engine());
  }
  return scan;
}

Pose small_motion(double position_m, double angle_deg) {
  const Eigen::Vector3d angles(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  const Eigen::Vector3d place(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  return make_pose_from_rpy(position_m * place, angle_deg * angles);
}

Trajectory shaken(const Trajectory& poses, double position_m, double angle_deg) {
  Trajectory moved = poses;
  for (TrajectoryPose& pose : moved) {
    const Eigen::Translation3d there(pose.world_from_base.translation());
    pose.world_from_base =
        there * small_motion(position_m, angle_deg) * there.inverse() * pose.world_from_base;
  }
  return moved;
}

// Root mean squares of position and rotation errors after alignment of the first frames, because
// the common frame is free.
struct PoseErrors {
  double position_m = 0.0;
  double angle_deg = 0.0;
};
PoseErrors errors_of(const Trajectory& poses, const Trajectory& truth) {
  PoseErrors errors;
  int pairs = 0;
  for (std::size_t a = 0; a < poses.size(); ++a)
    for (std::size_t b = 0; b < a; ++b, ++pairs) {
      const Pose off = (truth[a].world_from_base.inverse() * truth[b].world_from_base).inverse() *
                       (poses[a].world_from_base.inverse() * poses[b].world_from_base);
      errors.position_m += off.translation().squaredNorm();
      errors.angle_deg +=
          std::pow(Eigen::AngleAxisd(off.linear()).angle() * 180 / std::numbers::pi, 2);
    }
  return {std::sqrt(errors.position_m / pairs), std::sqrt(errors.angle_deg / pairs)};
}

TEST(FrameRegistration, ShakenPosesAreBroughtTogether) {
  const MemoryScan scan = ring_scan(rocky_ground(), 12);
  const Trajectory given = shaken(scan.poses, 0.01, 0.5);
  const PoseErrors before = errors_of(given, scan.poses);
  const DepthFusionResult result = fuse_depth(scan, given);
  const PoseErrors after = errors_of(result.poses, scan.poses);
  EXPECT_GT(before.position_m, 0.008);
  EXPECT_LT(after.position_m, 0.25 * before.position_m);
  EXPECT_LT(after.angle_deg, 0.25 * before.angle_deg);
  EXPECT_GT(result.registration_rounds, 0);
  EXPECT_GT(result.registration_shift_m, 0.003);
  EXPECT_GT(result.registration_turn_deg, 0.1);
  EXPECT_LT(result.disagreement_after_m, 0.7 * result.disagreement_before_m);
}

TEST(FrameRegistration, RightPosesStayAsTheyAreGiven) {
  const MemoryScan scan = ring_scan(rocky_ground(), 12);
  DepthFusionOptions none;
  none.registration_rounds = 0;
  const DepthFusionResult fixed = fuse_depth(scan, scan.poses, none);
  const DepthFusionResult free = fuse_depth(scan, scan.poses);
  EXPECT_EQ(free.registration_rounds, 0);
  EXPECT_EQ(free.registration_shift_m, 0.0);
  EXPECT_EQ(free.cloud.positions, fixed.cloud.positions);
  ASSERT_EQ(free.poses.size(), scan.poses.size());
  for (std::size_t n = 0; n < free.poses.size(); ++n)
    EXPECT_EQ(free.poses[n].world_from_base.matrix(), scan.poses[n].world_from_base.matrix());
}

TEST(FrameRegistration, PosesThatWereCorrectedNeedNoMore) {
  const MemoryScan scan = ring_scan(rocky_ground(), 12);
  const DepthFusionResult once = fuse_depth(scan, shaken(scan.poses, 0.01, 0.5));
  const DepthFusionResult twice = fuse_depth(scan, once.poses);
  EXPECT_EQ(twice.registration_rounds, 0);
}

TEST(FrameRegistration, SameBytesForAnyNumberOfThreads) {
  const MemoryScan scan = ring_scan(rocky_ground(), 8);
  const Trajectory given = shaken(scan.poses, 0.01, 0.5);
  std::optional<DepthFusionResult> first;
  for (const unsigned threads : {1U, 2U, 5U}) {
    const ThreadLimit limit(threads);
    DepthFusionResult result = fuse_depth(scan, given);
    if (!first) {
      first = std::move(result);
      EXPECT_GT(first->registration_rounds, 0);
      continue;
    }
    EXPECT_EQ(result.cloud.positions, first->cloud.positions);
    EXPECT_EQ(result.poses.back().world_from_base.matrix(),
              first->poses.back().world_from_base.matrix());
  }
}

TEST(FrameRegistration, FramesDoNotSlideOverAPlane) {
  const MemoryScan scan = ring_scan(plane_z(0), 8);
  Trajectory given = scan.poses;
  for (std::size_t n = 0; n < given.size(); ++n)
    given[n].world_from_base.translation().z() += n % 2 == 0 ? 0.01 : -0.01;
  const DepthFusionResult result = fuse_depth(scan, given);
  EXPECT_GT(result.registration_rounds, 0);
  for (std::size_t n = 0; n < given.size(); ++n) {
    const Eigen::Vector3d off =
        result.poses[n].world_from_base.translation() - scan.poses[n].world_from_base.translation();
    EXPECT_LT(off.head<2>().norm(), 0.004) << n << ' ' << off.transpose() * 1e3;
    EXPECT_LT(std::abs(off.z()), 0.002) << n;
  }
}

TEST(FrameRegistration, OneFrameAloneStays) {
  const MemoryScan scan = ring_scan(rocky_ground(), 1);
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_EQ(result.registration_rounds, 0);
  ASSERT_EQ(result.poses.size(), 1U);
}

// The corrections against the dense normal equations with the elements' heights as unknowns.
TEST(FrameRegistration, SolvesTheLeastSquaresProblem) {
  constexpr int frames = 3;
  constexpr int places = 40;
  std::vector<SurfaceElement> elements(places);
  std::vector<SurfaceObservation> observations;
  const std::vector<Eigen::Vector3d> centers = {{1, 0, 1}, {-1, 0.5, 1.2}, {0, -1, 0.8}};
  for (std::uint32_t e = 0; e < places; ++e) {
    elements[e].position = Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), 0).cast<float>();
    elements[e].normal =
        Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), 1).normalized().cast<float>();
    for (std::uint32_t f = 0; f < frames; ++f)
      if (e % 4 != f)
        observations.push_back({e, f, static_cast<float>(uniform(-1e-4, 1e-4)),
                                static_cast<float>(uniform(1e-6, 4e-6))});
  }
  FrameRegistrationOptions options;
  options.independent_heights = 1e9;
  options.scatter_m = 1.0;  // far beyond the heights: weights stay as they are
  const FrameRegistration found = register_frames(elements, observations, centers, options);

  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(6 * frames + places, 6 * frames + places);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(6 * frames + places);
  const double turn = options.rotation_error_deg * std::numbers::pi / 180;
  for (int f = 0; f < frames; ++f)
    for (int k = 0; k < 6; ++k)
      normal(6 * f + k, 6 * f + k) = 1 / std::pow(k < 3 ? turn : options.position_error_m, 2);
  for (const SurfaceObservation& one : observations) {
    const Eigen::Vector3d n = elements[one.element].normal.cast<double>();
    const Eigen::Vector3d arm = elements[one.element].position.cast<double>() - centers[one.frame];
    Eigen::VectorXd row = Eigen::VectorXd::Zero(right.size());
    row.segment<3>(6 * one.frame) = arm.cross(n);
    row.segment<3>(6 * one.frame + 3) = n;
    row[6 * frames + one.element] = -1;
    const double weight = 1 / (static_cast<double>(one.variance_m2) + 1.0);
    normal += weight * row * row.transpose();
    right -= weight * static_cast<double>(one.height_m) * row;
  }
  const Eigen::VectorXd solution = normal.ldlt().solve(right);
  for (int f = 0; f < frames; ++f) {
    const Pose& pose = found.corrected_from_given[static_cast<std::size_t>(f)];
    const Eigen::Vector3d shift =
        pose * centers[static_cast<std::size_t>(f)] - centers[static_cast<std::size_t>(f)];
    const Eigen::AngleAxisd rotation(pose.linear());
    EXPECT_LT((shift - solution.segment<3>(6 * f + 3)).norm(), 1e-10);
    EXPECT_LT((rotation.angle() * rotation.axis() - solution.segment<3>(6 * f)).norm(), 1e-9);
  }
}

// Colors of the frames of `scan` from a texture of the ground.
void paint(const Surface& surface, MemoryScan& scan) {
  for (const TrajectoryPose& pose : scan.poses) {
    RgbdFrame& frame = scan.frames.at(pose.node);
    const Camera& camera = frame.cameras.front();
    const Pose eye = pose.world_from_base * camera.base_from_camera;
    const auto rays = ray_table(camera);
    frame.color = ColorImage(camera.width, camera.height);
    for (std::size_t n = 0; n < rays.size(); ++n) {
      const Eigen::Vector3d ray = eye.linear() * rays[n].homogeneous();
      const Eigen::Vector3d place = eye.translation() + surface(eye.translation(), ray) * ray;
      const double wave = std::sin(70 * place.x()) * std::sin(60 * place.y() + 50 * place.z());
      frame.color.pixels[n].fill(static_cast<std::uint8_t>(128 + 100 * wave));
    }
  }
}

// Views from nearly one position, where color reveals each rotation. Depth is tilted alternately to
// the right and left, so that rotated frames improve the agreement of surfaces.
MemoryScan tilted_scan(const Surface& surface) {
  MemoryScan scan;
  for (int n = 0; n < 8; ++n)
    scan.see(surface, looking({1.0, 0.02 * n, 1.0}, {0, 0, 0.05}), small_camera(), {0.002, 0.002},
             random_engine());
  paint(surface, scan);
  for (auto& [node, frame] : scan.frames)
    for (int y = 0; y < frame.depth.height; ++y)
      for (int x = 0; x < frame.depth.width; ++x)
        frame.depth.at(x, y) *=
            1.0F + (node % 2 == 0 ? 0.03F : -0.03F) * static_cast<float>(x - 64) / 64.0F;
  return scan;
}

TEST(FrameRegistration, ColorRejectsWhatWrongDepthSuggests) {
  MemoryScan scan = tilted_scan(rocky_ground());
  const DepthFusionResult result = fuse_depth(scan, scan.poses);
  EXPECT_TRUE(result.registration_rejected);
  EXPECT_EQ(result.registration_rounds, 0);
  EXPECT_GT(result.registration_check.color.count, 1000U);
  EXPECT_TRUE(result.registration_check.color.is_clearly_worse());
  for (std::size_t n = 0; n < result.poses.size(); ++n)
    EXPECT_EQ(result.poses[n].world_from_base.matrix(), scan.poses[n].world_from_base.matrix());
  // Without color the registration is accepted, because depth does not reveal its own errors.
  for (auto& [node, frame] : scan.frames) frame.color = {};
  EXPECT_GT(fuse_depth(scan, scan.poses).registration_rounds, 0);
}

TEST(FrameRegistration, OnlyColorCorrectsRefinedPoses) {
  MemoryScan scan = ring_scan(rocky_ground(), 12);
  const Trajectory given = shaken(scan.poses, 0.01, 0.5);
  DepthFusionOptions refined;
  refined.refined_poses = true;
  const DepthFusionResult without = fuse_depth(scan, given, refined);
  EXPECT_TRUE(without.registration_rejected);
  EXPECT_EQ(without.registration_check.depth.count, 0U);
  EXPECT_EQ(without.poses[3].world_from_base.matrix(), given[3].world_from_base.matrix());
  paint(rocky_ground(), scan);
  const DepthFusionResult result = fuse_depth(scan, given, refined);
  EXPECT_FALSE(result.registration_rejected);
  EXPECT_TRUE(result.registration_check.color.is_clearly_better());
  EXPECT_LT(errors_of(result.poses, scan.poses).position_m,
            0.25 * errors_of(given, scan.poses).position_m);
}

TEST(FrameRegistration, ACheckWeighsBothKinds) {
  const PairCosts better{100, 1.0, 0.9, 0.01};
  const PairCosts worse{100, 1.0, 1.1, 0.01};
  const PairCosts a_little_worse{100, 1.0, 1.01, 0.01};
  const PairCosts none;
  const auto accepted = [](const PairCosts& depth, const PairCosts& color, bool refined) {
    return RegistrationCheck{depth, color}.is_accepted(refined);
  };
  EXPECT_TRUE(accepted(better, better, false));
  EXPECT_TRUE(accepted(better, none, false));
  EXPECT_TRUE(accepted(better, a_little_worse, false));
  EXPECT_FALSE(accepted(better, worse, false));
  EXPECT_FALSE(accepted(worse, better, false));
  EXPECT_FALSE(accepted(a_little_worse, none, false));
  EXPECT_FALSE(accepted(none, none, false));
  EXPECT_TRUE(accepted(a_little_worse, better, true));
  EXPECT_FALSE(accepted(better, none, true));
  EXPECT_FALSE(accepted(better, a_little_worse, true));
}

TEST(FrameRegistration, StoredPosesOfARealScanComeNearTheTruth) {
  GRASPMAP_REQUIRE_DATA();
  const auto scan = open_scan(graspmap_test::data_folder() / "scans/site_full.db");
  const Trajectory truth = trajectory_of(scan->graph(), PoseSource::ground_truth);
  const Trajectory stored = trajectory_of(scan->graph(), PoseSource::optimized);
  DepthFusionOptions options;
  options.color = false;
  const DepthFusionResult result = fuse_depth(*scan, stored, options);
  const PoseErrors before = errors_of(stored, truth);
  const PoseErrors after = errors_of(result.poses, truth);
  EXPECT_LT(after.position_m, 0.2 * before.position_m);
  EXPECT_LT(after.angle_deg, 0.2 * before.angle_deg);
}

}  // namespace frame_registration_test
}  // namespace libmap
