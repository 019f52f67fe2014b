#include "libmap/poses/trajectory_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "libmap/scan/scan_source.h"
#include "tests/support/test_support.h"

namespace trajectory_error_test {

using libmap::Pose;
using libmap::Trajectory;

Pose random_pose() {
  const auto draw = [] { return graspmap_test::uniform(-1.0, 1.0); };
  return libmap::make_pose(Eigen::Vector3d(draw(), draw(), draw()),
                           Eigen::Quaterniond(draw(), draw(), draw(), draw()));
}

Trajectory random_trajectory(int poses) {
  Trajectory trajectory;
  for (int i = 1; i <= poses; ++i) trajectory.push_back({i, 0.1 * i, random_pose()});
  return trajectory;
}

Trajectory moved(const Pose& motion, Trajectory trajectory) {
  for (libmap::TrajectoryPose& pose : trajectory)
    pose.world_from_base = motion * pose.world_from_base;
  return trajectory;
}

// Six poses on the axes: moving all of them along their axes by d, away from the center, turns
// nothing and leaves the center where it is.
Trajectory poses_on_axes(double distance) {
  Trajectory trajectory;
  for (int i = 0; i < 6; ++i) {
    Pose pose = Pose::Identity();
    pose.translation()[i / 2] = i % 2 == 0 ? distance : -distance;
    trajectory.push_back({i + 1, static_cast<double>(i), pose});
  }
  return trajectory;
}

TEST(AbsoluteTrajectoryError, IsZeroForTheSameTrajectoryInAnotherFrame) {
  const Trajectory truth = random_trajectory(20);
  const Pose estimate_from_truth = random_pose();
  const auto error = libmap::absolute_trajectory_error(moved(estimate_from_truth, truth), truth);
  EXPECT_EQ(error.poses, 20U);
  EXPECT_LT(error.max_m, 1e-12);
  EXPECT_LT(error.max_rotation_deg, 1e-6);
  EXPECT_TRUE(error.truth_from_estimate.isApprox(estimate_from_truth.inverse(), 1e-12));
}

// The rotation about a straight path is determined by the rotations, not by the noise of positions.
TEST(AbsoluteTrajectoryError, StraightWaysAreTurnedByTheirRotations) {
  const Pose estimate_from_truth = random_pose();
  Trajectory truth;
  Trajectory estimate;
  for (int i = 0; i < 6; ++i) {
    Pose pose = random_pose();
    pose.translation() = Eigen::Vector3d(0.1 * i, 0.2, 0.3);
    truth.push_back({i + 1, 0.1 * i, pose});
    Pose seen = estimate_from_truth * pose;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      seen.translation()[axis] += graspmap_test::uniform(-0.001, 0.001);
    estimate.push_back({i + 1, 0.1 * i, seen});
  }
  const auto error = libmap::absolute_trajectory_error(estimate, truth);
  EXPECT_LT(error.max_rotation_deg, 1e-4);
  EXPECT_LT(error.max_m, 0.002);
}

// Positions within a few mm of a line: their noise must not rotate the alignment.
TEST(AbsoluteTrajectoryError, NarrowPathsAreAlignedByRotationsToo) {
  for (int draw = 0; draw < 20; ++draw) {
    const Pose estimate_from_truth = random_pose();
    Trajectory truth;
    Trajectory estimate;
    for (int i = 0; i < 9; ++i) {
      Pose pose = libmap::make_pose(
          Eigen::Vector3d(0.0125 * i, 0.0035 * std::sin(i), 0.002 * std::cos(2 * i)),
          Eigen::Quaterniond(Eigen::AngleAxisd(0.05 * i, Eigen::Vector3d::UnitZ())));
      truth.push_back({i + 1, 0.1 * i, pose});
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        pose.translation()[axis] += graspmap_test::uniform(-0.0005, 0.0005);
        pose.rotate(
            Eigen::AngleAxisd(graspmap_test::uniform(-0.001, 0.001), Eigen::Vector3d::Unit(axis)));
      }
      estimate.push_back({i + 1, 0.1 * i, estimate_from_truth * pose});
    }
    const auto error = libmap::absolute_trajectory_error(estimate, truth);
    const Pose deviation = error.truth_from_estimate * estimate_from_truth;
    EXPECT_LT(Eigen::AngleAxisd(deviation.linear()).angle(), 0.001);
    EXPECT_LT(error.mean_rotation_deg, 0.1);
    EXPECT_LT(error.max_m, 0.002);
  }
}

// Rotations of another convention do not change the alignment by positions.
TEST(AbsoluteTrajectoryError, RotationsThatDisagreeDoNotCount) {
  Trajectory truth = random_trajectory(20);
  Trajectory estimate = moved(random_pose(), truth);
  for (libmap::TrajectoryPose& pose : estimate) {
    pose.world_from_base.rotate(Eigen::AngleAxisd(1.5, Eigen::Vector3d(1, 2, 3).normalized()));
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      pose.world_from_base.translation()[axis] += graspmap_test::uniform(-0.001, 0.001);
  }
  EXPECT_LT(libmap::absolute_trajectory_error(estimate, truth).max_m, 0.003);
}

// Two poses at one position and a third one next to them: positions on a line, without noise.
TEST(AbsoluteTrajectoryError, ExactPositionsOnALineAreTurnedByTheRotations) {
  const Pose estimate_from_truth = random_pose();
  Trajectory truth = random_trajectory(3);
  for (std::size_t i = 0; i < 3; ++i)
    truth[i].world_from_base.translation() = Eigen::Vector3d(i == 2 ? 0.1 : 0.0, 0.0, 0.0);
  const auto error = libmap::absolute_trajectory_error(moved(estimate_from_truth, truth), truth);
  EXPECT_LT(error.max_m, 1e-9);
  EXPECT_LT(error.max_rotation_deg, 1e-2);
}

TEST(AbsoluteTrajectoryError, KeepsScaleErrors) {
  const auto error = libmap::absolute_trajectory_error(poses_on_axes(1.01), poses_on_axes(1.0));
  EXPECT_NEAR(error.rmse_m, 0.01, 1e-12);
  EXPECT_NEAR(error.mean_m, 0.01, 1e-12);
  EXPECT_NEAR(error.median_m, 0.01, 1e-12);
  EXPECT_NEAR(error.max_m, 0.01, 1e-12);
  EXPECT_LT(error.max_rotation_deg, 1e-6);
}

TEST(AbsoluteTrajectoryError, TellsMeanMedianRmseAndMaximumApart) {
  // Opposite poses move equally: 1, 1, 2, 2, 6, 6 mm outwards.
  Trajectory estimate = poses_on_axes(1.0);
  const double outwards_m[] = {0.001, 0.002, 0.006};
  for (std::size_t i = 0; i < 6; ++i)
    estimate[i].world_from_base.translation() *= 1.0 + outwards_m[i / 2];
  const auto error = libmap::absolute_trajectory_error(estimate, poses_on_axes(1.0));
  EXPECT_NEAR(error.mean_m, 0.003, 1e-12);
  EXPECT_NEAR(error.median_m, 0.002, 1e-12);
  EXPECT_NEAR(error.rmse_m, std::sqrt((1e-6 + 4e-6 + 36e-6) / 3), 1e-12);
  EXPECT_NEAR(error.max_m, 0.006, 1e-12);
}

TEST(AbsoluteTrajectoryError, MeasuresRotationsAfterTheAlignment) {
  const Trajectory truth = poses_on_axes(1.0);
  Trajectory estimate = moved(random_pose(), truth);
  estimate[2].world_from_base.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()));
  const auto error = libmap::absolute_trajectory_error(estimate, truth);
  EXPECT_LT(error.max_m, 1e-12);
  EXPECT_NEAR(error.max_rotation_deg, 0.3 * 180.0 / M_PI, 1e-6);
  EXPECT_NEAR(error.mean_rotation_deg, 0.3 * 180.0 / M_PI / 6.0, 1e-6);
}

// Umeyama's alignment is optimal: no small motion improves it.
TEST(AbsoluteTrajectoryError, AlignsInTheLeastSquaresSense) {
  const Trajectory truth = random_trajectory(15);
  const Trajectory estimate = random_trajectory(15);
  const auto error = libmap::absolute_trajectory_error(estimate, truth);
  const auto rmse_with = [&](const Pose& alignment) {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      sum += (alignment * estimate[i].world_from_base.translation() -
              truth[i].world_from_base.translation())
                 .squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  };
  EXPECT_NEAR(rmse_with(error.truth_from_estimate), error.rmse_m, 1e-12);
  EXPECT_NEAR(error.truth_from_estimate.linear().determinant(), 1.0, 1e-12);
  for (int i = 0; i < 6; ++i) {
    for (const double amount : {-1e-3, 1e-3}) {
      Pose nudge = Pose::Identity();
      if (i < 3)
        nudge.translation()[i] = amount;
      else
        nudge.rotate(Eigen::AngleAxisd(amount, Eigen::Vector3d::Unit(i - 3)));
      EXPECT_GT(rmse_with(nudge * error.truth_from_estimate), error.rmse_m);
    }
  }
}

TEST(AbsoluteTrajectoryError, PairsByNode) {
  const Trajectory truth = random_trajectory(10);
  Trajectory estimate(truth.rbegin(), truth.rend());
  estimate.erase(estimate.begin() + 3);
  estimate.push_back({99, 0.5, random_pose()});
  for (libmap::TrajectoryPose& pose : estimate) pose.stamp_s = 0.0;  // not used
  const auto error = libmap::absolute_trajectory_error(estimate, truth);
  EXPECT_EQ(error.poses, 9U);
  EXPECT_LT(error.max_m, 1e-12);
}

TEST(AbsoluteTrajectoryError, PairsByTimeWhereNodesAreNotKnown) {
  const Trajectory truth = random_trajectory(10);
  Trajectory estimate = truth;
  for (libmap::TrajectoryPose& pose : estimate) {
    pose.node = 0;
    pose.stamp_s += 0.02;
  }
  EXPECT_EQ(libmap::absolute_trajectory_error(estimate, truth).poses, 10U);
  estimate[4].stamp_s += 0.002;
  const auto error = libmap::absolute_trajectory_error(estimate, truth);
  EXPECT_EQ(error.poses, 9U);
  EXPECT_LT(error.max_m, 1e-12);
}

TEST(AbsoluteTrajectoryError, WantsThreeCommonPoses) {
  const Trajectory truth = random_trajectory(3);
  EXPECT_NO_THROW(libmap::absolute_trajectory_error(truth, truth));
  const libmap::Error error = graspmap_test::error_of([&] {
    libmap::absolute_trajectory_error(Trajectory(truth.begin(), truth.begin() + 2), truth);
  });
  EXPECT_EQ(error.context().value, "2");
  EXPECT_EQ(error.context().bound, ">= 3");
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::absolute_trajectory_error({}, {}); }),
      {.field = "common poses", .value = "0", .bound = ">= 3"}));
}

TEST(RelativeTrajectoryError, SeesTheDriftOfEachStep) {
  // The estimate turns by 0.01 rad and moves 1 mm too far in each step of 1 m.
  Trajectory truth;
  Trajectory estimate;
  Pose true_pose = random_pose();
  Pose estimated_pose = random_pose();
  for (int i = 1; i <= 11; ++i) {
    truth.push_back({i, 0.0, true_pose});
    estimate.push_back({i, 0.0, estimated_pose});
    true_pose.translate(Eigen::Vector3d(1.0, 0.0, 0.0));
    estimated_pose.translate(Eigen::Vector3d(1.001, 0.0, 0.0));
    estimated_pose.rotate(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX()));
  }
  const auto one = libmap::relative_trajectory_error(estimate, truth);
  EXPECT_EQ(one.poses, 10U);
  EXPECT_NEAR(one.rmse_m, 0.001, 1e-12);
  EXPECT_NEAR(one.mean_rotation_deg, 0.01 * 180.0 / M_PI, 1e-6);
}

TEST(RelativeTrajectoryError, DoesNotDependOnTheFrames) {
  const Trajectory truth = random_trajectory(12);
  const Trajectory estimate = random_trajectory(12);
  const auto before = libmap::relative_trajectory_error(estimate, truth);
  const auto after = libmap::relative_trajectory_error(moved(random_pose(), estimate),
                                                       moved(random_pose(), truth));
  EXPECT_NEAR(before.rmse_m, after.rmse_m, 1e-12);
  EXPECT_NEAR(before.mean_rotation_deg, after.mean_rotation_deg, 1e-6);
}

TEST(RelativeTrajectoryError, RefusesOnePose) {
  const Trajectory truth = random_trajectory(1);
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::relative_trajectory_error(truth, truth); }),
      {.field = "common poses", .value = "1", .bound = ">= 2"}));
}

struct TabledError {
  const char* scan;
  libmap::PoseSource source;
  double rmse_mm;
  double max_mm;
  double mean_rotation_deg;
};

// Table in the README of the data, to the last digit.
TEST(AbsoluteTrajectoryError, AgreesWithTheTableOfTheRealScans) {
  GRASPMAP_REQUIRE_DATA();
  using libmap::PoseSource;
  const TabledError table[] = {{"site_full.db", PoseSource::odometry, 5.0, 11.0, 0.14},
                               {"site_full.db", PoseSource::optimized, 6.8, 11.2, 0.40},
                               {"site_drift.db", PoseSource::odometry, 42.3, 73.5, 1.21},
                               {"site_drift.db", PoseSource::optimized, 17.3, 40.7, 0.59}};
  for (const TabledError& expected : table) {
    SCOPED_TRACE(std::string(expected.scan) + " " + to_text(expected.source));
    const auto scan = libmap::open_scan(graspmap_test::data_folder() / "scans" / expected.scan);
    const auto error = libmap::absolute_trajectory_error(
        libmap::trajectory_of(scan->graph(), expected.source),
        libmap::trajectory_of(scan->graph(), libmap::PoseSource::ground_truth));
    EXPECT_EQ(error.poses, 40U);
    EXPECT_NEAR(error.rmse_m * 1000.0, expected.rmse_mm, 0.0501);
    EXPECT_NEAR(error.max_m * 1000.0, expected.max_mm, 0.0501);
    EXPECT_NEAR(error.mean_rotation_deg, expected.mean_rotation_deg, 0.00501);
  }
}

}  // namespace trajectory_error_test
